import type { Node, NodeProps } from "@xyflow/react";
import { memo } from "react";
import type { NodeBox, NodeRecord } from "../protocol/types";
import { activeInside, groupClass, limitOf } from "../state/looking";
import { isInside } from "../state/paths";
import { useStudio } from "../state/studio";
import { MeasureRow } from "./MeasureRow";
import { NodePorts } from "./NodePorts";
import { NodeTitle } from "./NodeTitle";
import { useZoom } from "./useView";
import { WhereLine } from "./WhereLine";

const isMuted = (record: NodeRecord | undefined): boolean => record?.enabled === false && "muted" in record.notes;

export type HfgNode = Node<{ box: NodeBox; plain: boolean }, "hfg">;

export const isHelper = (box: NodeBox): boolean => box.height < 68;
export const isBig = (box: NodeBox): boolean => box.height > 96;

/** Where the rows of a node are, from its upper edge. */
export function rowsOf(box: NodeBox): { title: number; measure: number } {
  const slots = box.ports.some((port) => port.kind === "slot" && port.says !== "");
  if (isHelper(box)) {
    const title = slots ? 16 : 3;
    return { title, measure: title + 20 };
  }
  return { title: 17, measure: 38 };
}

function useLook(path: string) {
  const active = useStudio((s) => path in s.activity.since);
  const inside = useStudio((s) => activeInside(s.activity, path));
  const failed = useStudio((s) => s.tables.studio.run?.error?.path === path || hasError(s.tables.problems, path));
  const selected = useStudio((s) => s.selection.has(path));
  const within = useStudio((s) => [...s.selection].some((one) => isInside(one, path)));
  const brk = useStudio((s) => s.tables.breakpoints[path]);
  return { active: active || inside !== null, inside, failed, selected, within, brk };
}

type Look = ReturnType<typeof useLook>;

function hasError(problems: Record<string, { path: string; severity: string; source: string }>, path: string): boolean {
  return Object.values(problems).some((one) => one.severity === "error" && one.path === path && one.source === "run");
}

function NodeViewPlain({ data }: NodeProps<HfgNode>) {
  const { box, plain } = data;
  const path = box.id;
  const record = useStudio((s) => s.tables.nodes[path]);
  const group = useStudio((s) => groupClass(s.tables, record?.group ?? box.group));
  const look = useLook(path);
  const limit = limitOf(record);
  const classes = [
    "node",
    group,
    box.kind === "subgraph" && !box.is_open && "sub",
    isHelper(box) && "helper",
    isBig(box) && "big",
    look.active && "active",
    look.failed && "bad failed",
    look.selected && "sel",
    !look.selected && look.within && "within",
    record?.enabled === false && "off",
    isMuted(record) && "muted-node",
    record?.missing && "missing",
    box.is_open && "open",
  ];
  const far = useZoom((s) => s.level === "far");
  const label = `${box.name}, ${look.active ? "active, " : ""}${box.type_name}, group ${record?.group ?? box.group}`;
  return (
    <>
      <div className={classes.filter(Boolean).join(" ")} data-node={path} role="img" aria-label={label}>
        {!far && <NodeInside box={box} look={look} plain={plain} record={record} />}
      </div>
      {!plain && !far && <NodePorts box={box} path={path} active={look.active} limit={limit} />}
    </>
  );
}

/** What one sees of a node that is not far away. */
function NodeInside({ box, look, plain, record }: { box: NodeBox; look: Look; plain: boolean; record: NodeRecord | undefined }) {
  const rows = rowsOf(box);
  const named = box.ports.some((port) => port.kind === "slot" && port.says !== "");
  const top = box.is_open ? (named && !plain ? 17 : 2) : plain ? box.height / 2 - (look.inside === null ? 10 : 18) : rows.title;
  const measure = plain ? box.height / 2 + 1 : rows.measure;
  return (
    <>
      <i className="stripe" />
      {look.brk && <i className={look.brk.holds ? "brk holds" : "brk"} title="The run pauses here (F9)" />}
      <NodeTitle box={box} record={record} top={top} plain={plain} />
      {box.is_open ? null : look.inside !== null ? (
        <WhereLine path={box.id} inside={look.inside} top={measure} />
      ) : (
        !plain && <MeasureRow box={box} top={rows.measure} missing={record?.missing ?? ""} failed={look.failed} off={record?.enabled === false ? (isMuted(record) ? "muted" : "disabled") : ""} />
      )}
    </>
  );
}

export const NodeView = memo(NodeViewPlain);
