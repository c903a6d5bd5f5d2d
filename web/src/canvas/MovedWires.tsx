import type { LayoutRecord } from "../protocol/types";
import { nodeOf, portOf } from "../state/paths";
import { loose } from "./geometry";
import type { HfgNode } from "./NodeView";

/** While a node is dragged its lines go straight there; the layout routes them anew when it lies. */
export function MovedWires({ layout, nodes, moved }: { layout: LayoutRecord; nodes: HfgNode[]; moved: ReadonlySet<string> }) {
  if (moved.size === 0) return null;
  const spot = (path: string): [number, number] | null => {
    const node = nodes.find((one) => one.id === nodeOf(path));
    const port = node?.data.box.ports.find((one) => one.name === portOf(path));
    if (!node || !port) return null;
    return [port.x - node.data.box.x + node.position.x, port.y - node.data.box.y + node.position.y];
  };
  return (
    <svg width="10" height="10" role="presentation">
      {layout.lines.flatMap((line) =>
        line.edges.map((edge) => {
          if (!moved.has(nodeOf(edge.source)) && !moved.has(nodeOf(edge.target))) return null;
          const [from, to] = [spot(edge.source), spot(edge.target)];
          if (!from || !to) return null;
          const d = loose(from, to, line.kind === "signal");
          return <path key={`${edge.source} ${edge.target}`} className={`wire ${line.is_active ? "act" : line.kind === "signal" ? "sig" : "data"}`} d={d} />;
        }),
      )}
    </svg>
  );
}
