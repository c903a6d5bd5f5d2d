import { applyNodeChanges, type NodeChange } from "@xyflow/react";
import { useCallback, useEffect, useRef, useState } from "react";
import type { LayoutRecord } from "../protocol/types";
import { edit, newGesture, select } from "../state/actions";
import { studio, useStudio } from "../state/studio";
import { edgeUnder, insert, markEdgeUnder } from "./inserting";
import type { HfgNode } from "./NodeView";

const NOTHING: ReadonlySet<string> = new Set();
/** React Flow need not measure a node whose size and handles it is told, so it does not mount those out of sight. */
const NO_HANDLES: [] = [];

function made(layout: LayoutRecord, selection: ReadonlySet<string>): HfgNode[] {
  return layout.nodes.map((box) => ({
    id: box.id,
    type: "hfg",
    position: { x: box.x, y: box.y },
    data: { box, plain: layout.view === "activity" },
    width: box.width,
    height: box.height,
    measured: { width: box.width, height: box.height },
    handles: NO_HANDLES,
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

  const [shown, setShown] = useState<LayoutRecord>();
  if (layout !== shown) {
    setShown(layout); // while it is drawn, not in an effect after it: the nodes of the level before are not drawn once more
    if (!dragging.current) {
      setNodes(layout ? made(layout, selection) : []);
      setMoved(NOTHING);
    }
  }

  useEffect(() => {
    const isRight = (node: HfgNode) => node.selected === selection.has(node.id);
    setNodes((before) => (before.every(isRight) ? before : before.map((node) => (isRight(node) ? node : { ...node, selected: selection.has(node.id) }))));
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
