import { applyNodeChanges, type NodeChange } from "@xyflow/react";
import { useCallback, useEffect, useRef, useState } from "react";
import type { LayoutRecord } from "../protocol/types";
import { edit, newGesture, select } from "../state/actions";
import { studio, useStudio } from "../state/studio";
import { edgeUnder, insert, markEdgeUnder } from "./inserting";
import type { HfgNode } from "./NodeView";

const NOTHING: ReadonlySet<string> = new Set();

function made(layout: LayoutRecord, selection: ReadonlySet<string>): HfgNode[] {
  return layout.nodes.map((box) => ({
    id: box.id,
    type: "hfg",
    position: { x: box.x, y: box.y },
    data: { box, plain: layout.view === "activity" },
    width: box.width,
    height: box.height,
    selected: selection.has(box.id),
    deletable: false,
    connectable: false,
    draggable: layout.view !== "activity" && !layout.deep && box.kind !== "feed",
    ...(box.is_open ? { style: { pointerEvents: "none" as const } } : {}), // what lies in it is reached through it
    ariaLabel: box.name,
  }));
}

/** The nodes as React Flow wants them. The layout gives their places; while somebody drags, the hand does. */
export function useNodes(layout: LayoutRecord | undefined) {
  const selection = useStudio((s) => s.selection);
  const [nodes, setNodes] = useState<HfgNode[]>([]);
  const [moved, setMoved] = useState<ReadonlySet<string>>(NOTHING);
  const dragging = useRef(false);

  useEffect(() => {
    if (dragging.current) return;
    setNodes(layout ? made(layout, studio().selection) : []);
    setMoved(NOTHING);
  }, [layout]);

  useEffect(() => {
    setNodes((before) =>
      before.map((node) => (node.selected === selection.has(node.id) ? node : { ...node, selected: selection.has(node.id) })),
    );
  }, [selection]);

  const onNodesChange = useCallback((changes: NodeChange<HfgNode>[]) => {
    setNodes((before) => applyNodeChanges(changes, before));
    const picks = changes.filter((one) => one.type === "select");
    if (picks.length === 0) return;
    const here = new Set(layout?.nodes.map((box) => box.id));
    const next = new Set([...studio().selection].filter((path) => here.has(path))); // what lies elsewhere was a choice of before
    for (const one of picks) {
      if (one.selected) next.add(one.id);
      else next.delete(one.id);
    }
    const before = studio().selection;
    if (next.size !== before.size || [...next].some((path) => !before.has(path))) select(next);
  }, [layout]);

  const onDragStart = useCallback((_: unknown, __: HfgNode, dragged: HfgNode[]) => {
    dragging.current = true;
    setMoved(new Set(dragged.map((node) => node.id)));
  }, []);

  const onDragStop = useCallback((_: unknown, __: HfgNode, dragged: HfgNode[]) => {
    dragging.current = false;
    const edge = edgeUnder(layout, dragged);
    if (edge) {
      const node = dragged[0]!;
      void insert(edge, node.id, [node.position.x, node.position.y]);
      return;
    }
    const gesture = newGesture();
    const commands = dragged.map((node) => ({
      do: "Note",
      path: node.id,
      name: "position",
      value: [Math.round(node.position.x), Math.round(node.position.y)],
    }));
    void edit(commands, gesture).then((done) => {
      if (done || !layout) return;
      setNodes(made(layout, studio().selection));
      setMoved(NOTHING);
    });
  }, [layout]);

  const onDrag = useCallback((_: unknown, __: HfgNode, dragged: HfgNode[]) => markEdgeUnder(edgeUnder(layout, dragged)), [layout]);

  return { nodes, moved, onNodesChange, onDragStart, onDrag, onDragStop };
}
