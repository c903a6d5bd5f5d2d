import type { NodeBox } from "../protocol/types";

const GRID = 8;

export type Alignment = "left" | "centre" | "right" | "top" | "middle" | "bottom";
export type Spot = [x: number, y: number];

const snapped = (value: number): number => Math.round(value / GRID) * GRID;

export function aligned(boxes: readonly NodeBox[], way: Alignment): Spot[] {
  const lefts = boxes.map((box) => box.x);
  const tops = boxes.map((box) => box.y);
  const right = Math.max(...boxes.map((box) => box.x + box.width));
  const bottom = Math.max(...boxes.map((box) => box.y + box.height));
  const [left, top] = [Math.min(...lefts), Math.min(...tops)];
  const place = (box: NodeBox): Spot => {
    switch (way) {
      case "left":
        return [left, box.y];
      case "right":
        return [right - box.width, box.y];
      case "centre":
        return [(left + right - box.width) / 2, box.y];
      case "top":
        return [box.x, top];
      case "bottom":
        return [box.x, bottom - box.height];
      case "middle":
        return [box.x, (top + bottom - box.height) / 2];
    }
  };
  return boxes.map(place).map(([x, y]) => [snapped(x), snapped(y)]);
}

/** The first and the last stay; the gaps between all become equal. */
export function distributed(boxes: readonly NodeBox[], axis: "x" | "y"): Spot[] {
  const side = axis === "x" ? "width" : "height";
  const order = [...boxes].sort((a, b) => a[axis] - b[axis]);
  const [first, last] = [order[0], order.at(-1)];
  if (!first || !last) return [];
  const room = last[axis] + last[side] - first[axis] - order.reduce((sum, box) => sum + box[side], 0);
  const gap = room / Math.max(1, order.length - 1);
  const starts = new Map<NodeBox, number>();
  let at = first[axis];
  for (const box of order) {
    starts.set(box, at);
    at += box[side] + gap;
  }
  return boxes.map((box) => (axis === "x" ? [snapped(starts.get(box)!), box.y] : [box.x, snapped(starts.get(box)!)]));
}
