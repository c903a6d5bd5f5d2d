import { describe, expect, it } from "vitest";
import { icicle, lanesOf, steps, tickStep, withoutCommon } from "./icicle";
import type { Span } from "./store";

const SPANS: Span[] = [
  ["fetch/go", 0, 1],
  ["fetch/visit/position", 1, 2],
  ["bring", 2.2, null],
];

describe("the icicle of activity", () => {
  it("joins what follows without a gap", () => {
    const rows = icicle(SPANS, 0, 3);
    expect(rows[0]!.map((one) => [one.name, one.begin, one.end, one.now])).toEqual([
      ["fetch", 0, 2, false],
      ["bring", 2.2, 3, true],
    ]);
    expect(rows[1]!.map((one) => one.name)).toEqual(["go", "visit"]);
    expect(rows[2]!.map((one) => one.name)).toEqual(["position"]);
  });
  it("names the rest of deep paths in the last row", () => {
    expect(icicle([["a/b/c/d", 0, 1]], 0, 1)[2]![0]!.name).toBe("c › d");
  });
  it("leaves out what has ended before the window", () => {
    expect(icicle(SPANS, 1.5, 3)[1]!.map((one) => one.name)).toEqual(["visit"]);
  });
  it("of the whole run has the steps alone", () => {
    expect(steps(SPANS, 3).map((one) => one.name)).toEqual(["fetch", "bring"]);
  });
});

it("a level that all spans share is left out", () => {
  const { spans, prefix } = withoutCommon([["r/a", 0, 1], ["r/b/c", 1, 2]]);
  expect(prefix).toBe("r");
  expect(spans.map((one) => one[0])).toEqual(["a", "b/c"]);
});

describe("what is active at the same time", () => {
  it("has a lane of its own, named after the subgraph around it", () => {
    const lanes = lanesOf([["x/robot_0/fetch/go", 0, 2], ["x/robot_1/advance", 0, 1], ["x/robot_1/fetch", 1, null]], 3);
    expect(lanes.map((one) => [one.prefix, one.spans.map(([path]) => path)])).toEqual([
      ["x/robot_0", ["fetch/go"]],
      ["x/robot_1", ["advance", "fetch"]],
    ]);
  });
  it("has one lane if it follows each other, or overlaps only while it is handed over", () => {
    expect(lanesOf([["fetch", 0, 1.02], ["bring", 1, 2], ["fetch", 2, null]], 3)).toHaveLength(1);
  });
  it("has four lanes at most", () => {
    const lanes = lanesOf(["a", "b", "c", "d", "e"].map((path) => [path, 0, 1]), 1);
    expect(lanes.map((one) => one.spans.length)).toEqual([1, 1, 1, 2]);
  });
});

it("ticks are wide enough to be read", () => {
  expect([0.1, 0.3, 1, 5, 14, 100, 1000].map(tickStep)).toEqual([0.02, 0.02, 0.1, 0.5, 1, 10, 60]);
});
