import type { LayoutRecord, Point } from "../protocol/types";
import { edit, insertOn, toast } from "../state/actions";
import { endsOf, nodeOf, portOf } from "../state/paths";
import { change, studio } from "../state/studio";
import { askTargets, type Judged, reasonOf } from "../state/targets";
import type { HfgNode } from "./NodeView";
import { keysOf } from "./Wires";

const NEAR = 14;

/** The edge that a dragged node lies on, if it has no edges of its own and could be put between. */
export function edgeUnder(layout: LayoutRecord | undefined, dragged: readonly HfgNode[]): string | null {
  const [node, more] = dragged;
  if (!layout || !node || more) return null;
  const edges = Object.values(studio().tables.edges);
  if (edges.some((edge) => nodeOf(edge.source) === node.id || nodeOf(edge.target) === node.id)) return null;
  const middle: Point = [node.position.x + (node.width ?? 0) / 2, node.position.y + (node.height ?? 0) / 2];
  for (const line of layout.lines) {
    if (line.edges.length !== 1 || line.tag) continue;
    const near = line.points.some((point, index) => index > 0 && distance(middle, line.points[index - 1]!, point) < NEAR);
    if (near) return keysOf(line)[0]!;
  }
  return null;
}

function distance(p: Point, a: Point, b: Point): number {
  const length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2;
  const share = length === 0 ? 0 : Math.min(1, Math.max(0, ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / length));
  return Math.hypot(p[0] - a[0] - share * (b[0] - a[0]), p[1] - a[1] - share * (b[1] - a[1]));
}

export function markEdgeUnder(edge: string | null): void {
  if (studio().insertAt !== edge) change({ insertAt: edge });
}

/** Puts a node between the ends of an edge; the studio says which of its ports fit. */
export async function insert(edge: string, path: string, place: [number, number]): Promise<void> {
  markEdgeUnder(null);
  const [source, target] = endsOf(edge);
  const input = best(await askTargets(source, edge), path);
  const output = best(await askTargets(target, edge), path);
  const refused = input.why || output.why;
  if (input.port === "" || output.port === "") {
    toast(refused || `${path} has no port that fits there.`, { kind: "warn" });
    await edit([{ do: "Note", path, name: "position", value: place }]);
    return;
  }
  await insertOn(edge, path, portOf(input.port), portOf(output.port));
}

function best(targets: Judged, path: string): { port: string; why: string } {
  const own = [...targets.ports].filter(([port]) => nodeOf(port) === path);
  const found = own.find(([, fit]) => fit.fit === "expects") ?? own.find(([, fit]) => fit.fit === "takes");
  const [first] = own;
  return { port: found?.[0] ?? "", why: first && first[1].fit === "refused" ? reasonOf(first[1], first[0]) : "" };
}
