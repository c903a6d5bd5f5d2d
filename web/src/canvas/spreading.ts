import type { LayoutLine, Point } from "../protocol/types";
import { edgeKey } from "../state/paths";
import type { Spot } from "./wiring";

/** How far apart the edges of a bundle lie when it is spread. */
const APART = 7;
const STUB = 6;

export interface Strand {
  key: string;
  points: Point[];
}

/** The edges of a bundle one beside the other, each from its own port to its own port. */
export function spread(line: LayoutLine, spots: ReadonlyMap<string, Spot>): Strand[] {
  const [first, second] = line.points;
  if (!first || !second) return [];
  const [side] = normals(line.points);
  const where = (path: string): number => {
    const spot = spots.get(path);
    return spot ? spot.x * side![0] + spot.y * side![1] : 0;
  };
  const edges = [...line.edges].sort((a, b) => where(a.source) - where(b.source));
  return edges.map((edge, index) => {
    const trunk = shifted(line.points, (index - (edges.length - 1) / 2) * APART);
    return { key: edgeKey(edge.source, edge.target), points: [...lead(spots.get(edge.source), trunk[0]!), ...trunk, ...lead(spots.get(edge.target), trunk.at(-1)!).reverse()] };
  });
}

/** From a port to where the trunk begins: a short way straight out of it, then across. */
function lead(spot: Spot | undefined, to: Point): Point[] {
  if (!spot) return [];
  const from: Point = [spot.x, spot.y];
  if (spot.kind === "slot" || spot.kind === "event" || spot.kind === "timeout") {
    const y = from[1] + (spot.kind === "slot" ? -STUB : STUB);
    return [from, [from[0], y], [to[0], y]];
  }
  const x = from[0] + Math.sign(to[0] - from[0] || 1) * STUB;
  return [from, [x, from[1]], [x, to[1]]];
}

/** The unit vectors across each part of a line, to its right. */
function normals(points: readonly Point[]): Point[] {
  return points.slice(1).map((point, index) => {
    const before = points[index]!;
    const length = Math.hypot(point[0] - before[0], point[1] - before[1]) || 1;
    return [-(point[1] - before[1]) / length || 0, (point[0] - before[0]) / length || 0];
  });
}

/** A line with right angles, moved to its side. */
export function shifted(points: readonly Point[], by: number): Point[] {
  const across = normals(points);
  return points.map(([x, y], index) => {
    const [before, after] = [across[index - 1], across[index]];
    const both = before && after && (before[0] !== after[0] || before[1] !== after[1]);
    const [dx, dy] = both ? [before[0] + after[0], before[1] + after[1]] : (after ?? before ?? [0, 0]);
    return [x + dx * by, y + dy * by];
  });
}
