import { expect, it } from "vitest";
import { digits, niceStep, rangeOf, tidy } from "./range";

const of = (more: object) => ({ low: null, high: null, limits: null, default: 2, kind: "float", ...more });

it("a slider goes from limit to limit, or around its default", () => {
  expect(rangeOf(of({ limits: { ge: 1, le: 9 } }), 2)).toEqual([1, 9]);
  expect(rangeOf(of({}), 2)).toEqual([0, 5]);
  expect(rangeOf(of({}), 12)).toEqual([0, 12]);
  expect(rangeOf(of({ limits: { ge: 1, le: 32767 }, default: 20 }), 20)).toEqual([1, 51]); // one could not drag in all of it
  expect(rangeOf(of({ kind: "int", default: 0 }), 0)).toEqual([0, 100]);
});

it("values have no more digits than the step", () => {
  expect(niceStep(5)).toBeCloseTo(0.1);
  expect(tidy(1.2345, 0.1, false)).toBe(1.2);
  expect(tidy(1.6, 1, true)).toBe(2);
  expect(digits(4, 0.1, false)).toBe("4.0");
});
