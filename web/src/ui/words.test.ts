import { expect, it } from "vitest";
import { duration, plural, rate, short } from "./words";

it("durations have as many digits as they deserve", () => {
  expect([0.0000071, 0.0001, 0.00064, 0.0142, 1.5, 12.34].map(duration)).toEqual(["7 µs", "0.10 ms", "0.64 ms", "14.2 ms", "1.50 s", "12.3 s"]);
  expect(duration(null)).toBe("–");
});

it("what does not fire is idle", () => {
  expect([0, 9.94, 219.3].map(rate)).toEqual(["idle", "9.9 Hz", "219 Hz"]);
});

it("counts and values are short", () => {
  expect(plural(1, "node")).toBe("1 node");
  expect(plural(1200, "node")).toBe("1,200 nodes");
  expect(short(0.1 + 0.2)).toBe("0.3");
});
