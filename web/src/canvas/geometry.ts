import type { LayoutRecord, Point } from "../protocol/types";

/** The path of corners, each rounded as far as its two sides allow. */
export function rounded(points: readonly Point[], radius = 7): string {
  const first = points[0];
  if (!first) return "";
  let path = `M${first[0]} ${first[1]}`;
  for (let index = 1; index < points.length - 1; index++) {
    const [a, b, c] = [points[index - 1]!, points[index]!, points[index + 1]!];
    const before = Math.hypot(b[0] - a[0], b[1] - a[1]);
    const after = Math.hypot(c[0] - b[0], c[1] - b[1]);
    const r = Math.min(radius, before / 2, after / 2);
    if (r === 0) continue;
    path += `L${b[0] - ((b[0] - a[0]) / before) * r} ${b[1] - ((b[1] - a[1]) / before) * r}`;
    path += `Q${b[0]} ${b[1]} ${b[0] + ((c[0] - b[0]) / after) * r} ${b[1] + ((c[1] - b[1]) / after) * r}`;
  }
  const last = points.at(-1)!;
  return `${path}L${last[0]} ${last[1]}`;
}

/** The tip at the end of a line, before the port that lies there. */
export function tipOf(points: readonly Point[]): string {
  const [p, q] = [points.at(-2), points.at(-1)];
  if (!p || !q) return "";
  const dx = Math.sign(q[0] - p[0]);
  const dy = Math.sign(q[1] - p[1]);
  const [x, y] = [q[0] - dx * 5, q[1] - dy * 5];
  return `M${x} ${y}L${x - dx * 6 - dy * 4} ${y - dy * 6 - dx * 4}L${x - dx * 6 + dy * 4} ${y - dy * 6 + dx * 4}z`;
}

export const pointsDown = (points: readonly Point[]): boolean => {
  const [p, q] = [points.at(-2), points.at(-1)];
  return p !== undefined && q !== undefined && p[0] === q[0] && q[1] > p[1];
};

/** The middle of the longest part of a line. */
export function middleOf(points: readonly Point[]): Point {
  let best: Point = points[0] ?? [0, 0];
  let longest = -1;
  for (let index = 1; index < points.length; index++) {
    const [p, q] = [points[index - 1]!, points[index]!];
    const length = Math.abs(q[0] - p[0]) + Math.abs(q[1] - p[1]);
    if (length <= longest) continue;
    longest = length;
    best = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
  }
  return best;
}

/** Whether a line may be seen in a box; the box around the line decides. */
export function meets(points: readonly Point[], { x, y, width, height }: Box): boolean {
  const [xs, ys] = [points.map((one) => one[0]), points.map((one) => one[1])];
  return Math.min(...xs) <= x + width && Math.max(...xs) >= x && Math.min(...ys) <= y + height && Math.max(...ys) >= y;
}

/** The line that follows the mouse. */
export function loose(from: Point, to: Point, upright: boolean): string {
  const bend = Math.max(24, Math.min(120, Math.hypot(to[0] - from[0], to[1] - from[1]) / 2));
  if (upright) return `M${from[0]} ${from[1]}C${from[0]} ${from[1] + bend},${to[0]} ${to[1] - bend},${to[0]} ${to[1]}`;
  return `M${from[0]} ${from[1]}C${from[0] + bend} ${from[1]},${to[0] - bend} ${to[1]},${to[0]} ${to[1]}`;
}

export type Zoom = "far" | "middle" | "near";
export const zoomOf = (z: number): Zoom => (z < 0.45 ? "far" : z <= 1.25 ? "middle" : "near");

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** What a layout takes up: people put nodes anywhere, also to the left of where it begins. */
export function boundsOf({ nodes, lines }: Pick<LayoutRecord, "nodes" | "lines">): Box {
  let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity];
  const take = (x: number, y: number, width = 0, height = 0) => {
    left = Math.min(left, x);
    top = Math.min(top, y);
    right = Math.max(right, x + width);
    bottom = Math.max(bottom, y + height);
  };
  for (const one of nodes) take(one.x, one.y, one.width, one.height);
  for (const { points, tag } of lines) {
    for (const [x, y] of points) take(x, y);
    if (tag) take(tag.x, tag.y, tag.width, tag.height);
  }
  return left === Infinity ? { x: 0, y: 0, width: 0, height: 0 } : { x: left, y: top, width: right - left, height: bottom - top };
}

export interface View {
  x: number;
  y: number;
  zoom: number;
}

/** How a level is shown first: all of it if one can read it then, else its upper end at a size that one can read. */
export function firstView(box: Box, canvasWidth: number, canvasHeight: number): View {
  const room = 48;
  const wide = (canvasWidth - room) / Math.max(1, box.width);
  const all = Math.min(wide, (canvasHeight - room) / Math.max(1, box.height));
  const zoom = Math.max(0.08, Math.min(1, Math.max(all, Math.min(wide, 0.89))));
  const top = box.height * zoom > canvasHeight - room ? 24 : (canvasHeight - box.height * zoom) / 2;
  return { x: (canvasWidth - box.width * zoom) / 2 - box.x * zoom, y: top - box.y * zoom, zoom };
}

export function allInView(box: Box, canvasWidth: number, canvasHeight: number): View {
  const zoom = Math.max(0.02, Math.min(1, (canvasWidth - 48) / Math.max(1, box.width), (canvasHeight - 48) / Math.max(1, box.height)));
  return { x: (canvasWidth - box.width * zoom) / 2 - box.x * zoom, y: (canvasHeight - box.height * zoom) / 2 - box.y * zoom, zoom };
}

/** How much of the lower edge of the canvas has buttons on its left and the legend on its right. */
const STRIP = 52;
const BUTTONS = 260;
const LEGEND = 540;

/** A view that shows all of a level, and no node of it under the buttons or the legend. */
export function clearOf(choose: typeof allInView, layout: Pick<LayoutRecord, "nodes" | "lines">, width: number, height: number): View {
  const box = boundsOf(layout);
  const view = choose(box, width, height);
  const hidden = layout.nodes.some((one) => {
    const [left, right] = [one.x * view.zoom + view.x, (one.x + one.width) * view.zoom + view.x];
    return (one.y + one.height) * view.zoom + view.y > height - STRIP && (left < BUTTONS || right > width - LEGEND);
  });
  const isWhole = box.height * view.zoom <= height - 48;
  return hidden && isWhole ? choose(box, width, height - STRIP) : view;
}
