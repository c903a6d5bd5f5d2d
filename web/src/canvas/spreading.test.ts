import { expect, it } from "vitest";
import type { LayoutLine } from "../protocol/types";
import { shifted, spread } from "./spreading";
import type { Spot } from "./wiring";

it("a line that is moved to its side stays parallel to where it was", () => {
  expect(shifted([[0, 0], [100, 0], [100, 50]], 4)).toEqual([[0, 4], [96, 4], [96, 50]]);
  expect(shifted([[0, 0], [50, 0], [100, 0]], -3)).toEqual([[0, -3], [50, -3], [100, -3]]);
});

it("each edge of a bundle leads from its own port to its own port, and they do not cross at the begin", () => {
  const spot = (path: string, kind: Spot["kind"], x: number, y: number): [string, Spot] => [path, { path, kind, x, y }];
  const spots = new Map([spot("a.one", "output", 0, 0), spot("a.two", "output", 0, 12), spot("b.one", "input", 200, 50), spot("b.two", "input", 200, 62)]);
  const edges = [
    { source: "a.two", target: "b.two", label: "" },
    { source: "a.one", target: "b.one", label: "" },
  ];
  const line = { edges, points: [[12, 6], [100, 6], [100, 56], [188, 56]] } as unknown as LayoutLine;
  const [upper, lower] = spread(line, spots);
  expect([upper!.key, lower!.key]).toEqual(["a.one -> b.one", "a.two -> b.two"]);
  expect([upper!.points[0], upper!.points.at(-1)]).toEqual([[0, 0], [200, 50]]);
  expect(lower!.points[3]![1] - upper!.points[3]![1]).toBe(7);
});
