import type { LayoutRecord } from "../protocol/types";
import { describe, expect, it } from "vitest";
import { allInView, boundsOf, clearOf, firstView, meets, middleOf, rounded, tipOf, zoomOf } from "./geometry";

describe("lines", () => {
  it("have rounded corners that are no larger than half of a side", () => {
    expect(rounded([[0, 0], [0, 6], [40, 6]])).toBe("M0 0L0 3Q0 6 3 6L40 6");
  });
  it("go straight through a corner that is none", () => {
    expect(rounded([[0, 0], [0, 0], [10, 0]])).toBe("M0 0L10 0");
  });
  it("end in a tip before the port", () => {
    expect(tipOf([[0, 0], [0, 20]])).toBe("M0 15L-4 9L4 9z");
  });
  it("of nothing are nothing", () => {
    expect(rounded([])).toBe("");
    expect(tipOf([[1, 1]])).toBe("");
  });
});

const box = (width: number, height: number) => ({ x: 0, y: 0, width, height });

describe("the first view of a level", () => {
  it("shows all of it where one can read it then", () => {
    expect(firstView(box(1112, 724), 1076, 643).zoom).toBeCloseTo(0.89, 2);
  });
  it("shows the upper end of a high level, and not less of its width", () => {
    const view = firstView(box(880, 1200), 1076, 643);
    expect(view.zoom).toBeCloseTo(0.89, 2);
    expect(view.y).toBe(24);
  });
  it("never enlarges", () => {
    expect(firstView(box(100, 100), 1076, 643).zoom).toBe(1);
    expect(allInView(box(100, 100), 1076, 643).zoom).toBe(1);
  });
  it("shows what somebody has put to the left of the origin", () => {
    const nodes = [{ x: -2000, y: 0, width: 200, height: 72 }, { x: 0, y: 0, width: 200, height: 72 }] as LayoutRecord["nodes"];
    const { x, zoom } = allInView(boundsOf({ nodes, lines: [] }), 1076, 643);
    expect(-2000 * zoom + x).toBeCloseTo(24);
    expect(200 * zoom + x).toBeCloseTo(1076 - 24);
  });
  it("shows no node under the buttons or the legend", () => {
    const [corner, middle] = [
      [{ x: 0, y: 0, width: 200, height: 72 }, { x: 0, y: 1000, width: 200, height: 72 }],
      [{ x: 0, y: 0, width: 2000, height: 72 }, { x: 700, y: 1000, width: 200, height: 72 }],
    ] as LayoutRecord["nodes"][];
    const wide = [{ points: [[0, 0], [2000, 0]] }] as unknown as LayoutRecord["lines"];
    const { y, zoom } = clearOf(allInView, { nodes: corner!, lines: wide }, 1076, 643);
    expect(1072 * zoom + y).toBeLessThan(643 - 52);
    const all = clearOf(allInView, { nodes: middle!, lines: [] }, 1076, 643);
    expect(all).toEqual(allInView(boundsOf({ nodes: middle!, lines: [] }), 1076, 643));
  });
  it("is far, middle or near", () => {
    expect([0.44, 0.45, 1.25, 1.26].map(zoomOf)).toEqual(["far", "middle", "middle", "near"]);
  });
});

it("a mark lies on the longest part of a line", () => {
  expect(middleOf([[0, 0], [10, 0], [10, 60], [30, 60]])).toEqual([10, 30]);
  expect(middleOf([[4, 5]])).toEqual([4, 5]);
});

it("a line is in sight where the box around it is", () => {
  const sight = { x: 0, y: 0, width: 100, height: 50 };
  expect(meets([[-20, 20], [-5, 20]], sight)).toBe(false);
  expect(meets([[-20, 20], [120, 20]], sight)).toBe(true);
  expect(meets([[50, 51], [50, 90]], sight)).toBe(false);
});
