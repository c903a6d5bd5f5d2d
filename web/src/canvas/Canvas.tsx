import "@xyflow/react/dist/base.css";
import { Background, BackgroundVariant, ReactFlow, ReactFlowProvider, ViewportPortal } from "@xyflow/react";
import { memo, type ReactNode, type RefObject, useMemo, useRef } from "react";
import { change, layoutKey, useStudio } from "../state/studio";
import type { LayoutRecord } from "../protocol/types";
import { enter } from "../state/actions";
import { isInside, parentOf } from "../state/paths";
import { counted, plural } from "../ui/words";
import { AskedWires } from "./AskedWires";
import { Annotations } from "./Annotations";
import { FarOverlay } from "./FarOverlay";
import { MovedWires } from "./MovedWires";
import { type HfgNode, NodeView } from "./NodeView";
import { Tags } from "./Tags";
import { useCanvasEvents } from "./useCanvasEvents";
import { useNodes } from "./useNodes";
import { useView } from "./useView";
import { ValueTip } from "./ValueTip";
import { WireDrag } from "./WireDrag";
import { Wires } from "./Wires";
import { type Spot, spotsOf } from "./wiring";
import { Mini, Zoomer } from "./Zoomer";

const NODE_TYPES = { hfg: NodeView };

export function Canvas() {
  return (
    <ReactFlowProvider>
      <Inner />
    </ReactFlowProvider>
  );
}

function Inner() {
  const root = useRef<HTMLElement>(null);
  const layout = useStudio((s) => s.tables.layouts[layoutKey(s)]);
  const spots = useMemo(() => (layout ? spotsOf(layout) : NO_SPOTS), [layout]);
  const { nodes, moved, onNodesChange, onDragStart, onDrag, onDragStop } = useNodes(layout);
  const hands = useMemo(() => new Map(nodes.filter((one) => moved.has(one.id)).map((one) => [one.id, one.position])), [nodes, moved]);
  const view = useView(root, layout);
  const events = useCanvasEvents(spots, layout);
  const classes = [view.level, view.partly && "partly", layout?.view === "activity" && "view-activity"].filter(Boolean).join(" ");
  return (
    <Ground root={root} classes={classes} events={events}>
      <ReactFlow
        nodes={nodes}
        edges={NO_EDGES}
        nodeTypes={NODE_TYPES}
        onNodesChange={onNodesChange}
        onNodeDragStart={onDragStart}
        onNodeDrag={onDrag}
        onNodeDragStop={onDragStop}
        onSelectionDragStart={(event, dragged) => onDragStart(event, dragged[0]!, dragged)}
        onSelectionDragStop={(event, dragged) => onDragStop(event, dragged[0]!, dragged)}
        onNodeDoubleClick={open}
        onPaneClick={unpick}
        onMove={view.onMove}
        onMoveEnd={view.onMoveEnd}
        minZoom={0.02}
        maxZoom={4}
        snapToGrid
        snapGrid={SNAP}
        nodeDragThreshold={4}
        onlyRenderVisibleElements
        zoomOnDoubleClick={false}
        nodesConnectable={false}
        nodesFocusable={false}
        elevateNodesOnSelect
        disableKeyboardA11y
        deleteKeyCode={null}
        panActivationKeyCode="Space"
        multiSelectionKeyCode={MULTI}
        proOptions={PRO}
      >
        <Background variant={BackgroundVariant.Dots} gap={16} size={1} color="var(--grid)" />
        {layout && (
          <ViewportPortal>
            <div className="frames">
              <Annotations layout={layout} kind="frame" moved={hands} />
            </div>
            <div className="under">
              <Wires layout={layout} moved={moved} spots={spots} />
              <AskedWires layout={layout} spots={spots} />
              <MovedWires layout={layout} nodes={nodes} moved={moved} />
            </div>
            <Tags layout={layout} />
            <Annotations layout={layout} kind="note" moved={hands} />
          </ViewportPortal>
        )}
        {layout && view.level === "far" && <FarOverlay layout={layout} />}
        {view.partly && <Mini />}
      </ReactFlow>
      <WireDrag spots={spots} />
      <ValueTip />
      {layout?.view === "activity" && <ActivityLegend layout={layout} />}
      <Zoomer showAll={view.showAll} />
      {layout?.nodes.length === 0 && <NothingHere />}
      {layout?.nodes.length === 1 && layout.lines.length === 0 && <p className="nothing-here first-node">Drag from a port to connect it. Drop the wire on nothing to choose what comes next.</p>}
    </Ground>
  );
}

/** Either there are no nodes, or the view shows none of them. */
function NothingHere() {
  const hasNodes = useStudio((s) => Object.keys(s.tables.nodes).some((path) => path !== s.level && parentOf(path) === s.level));
  const says = hasNodes ? "No node here takes part in activity. Press 3 to see all edges." : "Nothing here yet. Press Tab, or click twice, to add a node.";
  return <p className="nothing-here">{says}</p>;
}

const NO_EDGES: never[] = [];
const NO_SPOTS: Map<string, Spot> = new Map();
const unpick = () => change({ selectedEdge: null, annotation: null, menu: null });

function open(_: unknown, node: HfgNode): void {
  if (node.data.box.kind === "subgraph") enter(node.id);
  else change({ renaming: node.id });
}

interface GroundProps {
  root: RefObject<HTMLElement | null>;
  classes: string;
  events: ReturnType<typeof useCanvasEvents>;
  children: ReactNode;
}

/** It knows of a wire that is being drawn, so that nothing on it is drawn again when one begins or ends. */
function Ground({ root, classes, events, children }: GroundProps) {
  const wiring = useStudio((s) => s.wire !== null);
  return (
    <main id="canvas" ref={root} className={wiring ? `${classes} wiring` : classes} aria-label="Graph" tabIndex={-1} {...events}>
      {children}
    </main>
  );
}
const SNAP: [number, number] = [8, 8];
const MULTI = ["Control", "Meta", "Shift"];
const PRO = { hideAttribution: false };

/** What the lines of this view mean, and how much it leaves out. */
const ActivityLegend = memo(function ActivityLegend({ layout }: { layout: LayoutRecord }) {
  const all = useStudio((s) => Object.values(s.tables.edges).filter((one) => one.level === s.level || (layout.deep && isInside(one.level, s.level))).length);
  return (
    <div className="legend" style={{ right: 12, bottom: "auto", top: 12 }}>
      <span>
        <svg width="28" height="8" aria-hidden="true">
          <path d="M0 4h28" className="wire act" />
          <path d="M0 4h28" className="wire core" />
        </svg>
        activity
      </span>
      <span>
        <svg width="28" height="8" aria-hidden="true">
          <path d="M0 4h28" stroke="var(--edge)" strokeWidth="1.5" />
        </svg>
        data it asks for
      </span>
      <span>
        <i style={{ border: "2px solid var(--on)", background: "none" }} />
        active
      </span>
      <span className="muted num">
        {layout.hidden === 0 ? "no edges hidden" : `${counted(layout.hidden)} of ${plural(all, "edge")} hidden`}
      </span>
    </div>
  );
});
