import { MiniMap, useReactFlow, useStore } from "@xyflow/react";
import { useMemo } from "react";
import { arrange, openAll } from "../state/actions";
import { studio, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import type { HfgNode } from "./NodeView";

export function Zoomer({ showAll }: { showAll: () => void }) {
  const flow = useReactFlow();
  const deep = useStudio((s) => s.deep[s.level] ?? false);
  const percent = useStore((s) => Math.round(s.transform[2] * 100));
  return (
    <div className="zoomer">
      <button type="button" className="btn" aria-label="Zoom out" onClick={() => void flow.zoomOut({ duration: 120 })}>
        <Icon name="minus" />
      </button>
      <button type="button" className="btn num" style={{ minWidth: 48 }} aria-label="Zoom to 100 %" onClick={() => void flow.zoomTo(1, { duration: 120 })}>
        {percent} %
      </button>
      <button type="button" className="btn" aria-label="Zoom in" onClick={() => void flow.zoomIn({ duration: 120 })}>
        <Icon name="plus" />
      </button>
      <button type="button" className="btn" aria-label="Show all (Home)" title="Show all (Home)" onClick={showAll}>
        <Icon name="fit" />
      </button>
      <button type="button" className={deep ? "btn sel" : "btn"} aria-pressed={deep} aria-label="Open all subgraphs (U)" title="Open all subgraphs (U)" onClick={openAll}>
        <Icon name="nested" />
      </button>
      <button type="button" className="btn" aria-label="Lay out" title="Lay out all, or the selection" onClick={() => void arrange(null)}>
        <Icon name="layout" />
      </button>
    </div>
  );
}

const GROUP_COLOURS = ["var(--line2)", "var(--g1)", "var(--g2)", "var(--g3)", "var(--g4)"];

function miniColour(node: HfgNode, since: Readonly<Record<string, number>>): string {
  if (node.data.box.is_open) return "transparent";
  const { tables } = studio();
  const path = node.id;
  if (Object.keys(since).some((one) => one === path || one.startsWith(`${path}/`))) return "var(--on)";
  if (tables.studio.run?.error?.path.startsWith(path)) return "var(--bad)";
  const number = tables.groups[tables.nodes[path]?.group ?? ""]?.number ?? 0;
  return GROUP_COLOURS[number === 0 ? 0 : ((number - 1) % 4) + 1]!;
}

/** Its colours follow the activity. */
export function Mini() {
  const since = useStudio((s) => s.activity.since);
  const colour = useMemo(() => (node: HfgNode) => miniColour(node, since), [since]);
  return <MiniMap<HfgNode> className="mini" pannable zoomable nodeColor={colour} nodeBorderRadius={8} ariaLabel="Overview of this level" />;
}
