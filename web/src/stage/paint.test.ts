import { expect, it } from "vitest";
import { placed } from "./paint";

it("y leads upwards in a world", () => {
  const { at, height } = placed([-6, -3, 6, 3], 120);
  expect(height).toBe(60);
  expect(at([-6, 3])).toEqual([0, 0]);
  expect(at([6, -3])).toEqual([120, 60]);
  expect(at([0, 0])).toEqual([60, 30]);
});

it("y leads downwards where the bottom is the larger number, as in images", () => {
  const { at, height } = placed([0, 480, 640, 0], 320);
  expect(height).toBe(240);
  expect(at([0, 0])).toEqual([0, 0]);
  expect(at([640, 480])).toEqual([320, 240]);
});
