import { useReactFlow } from "@xyflow/react";
import { type MouseEvent, type PointerEvent, useEffect } from "react";
import type { LayoutRecord } from "../protocol/types";
import { change, studio } from "../state/studio";
import { addAnnotation } from "../state/annotating";
import { select } from "../state/actions";
import { hideTip, showTip } from "./tips";
import { beginWire, dropWire, endWire, nearest, openPalette, restOn, type Spot } from "./wiring";

/** What the mouse does on the canvas besides what React Flow does: wires, menus, the palette, values at the mouse. */
export function useCanvasEvents(spots: Map<string, Spot>, layout: LayoutRecord | undefined) {
  const flow = useReactFlow();

  useEffect(() => {
    const move = (event: globalThis.PointerEvent) => {
      const wire = studio().wire;
      if (!wire) return;
      const point = flow.screenToFlowPosition({ x: event.clientX, y: event.clientY }, { snapToGrid: false });
      const under = portAt(event.clientX, event.clientY);
      const over = under !== null && under !== wire.from ? under : nearest(spots, point.x, point.y, flow.getZoom(), wire.from);
      change({ wire: { ...wire, point, over, screen: { x: event.clientX, y: event.clientY }, active: event.altKey } });
    };
    const up = (event: globalThis.PointerEvent) => {
      if (!studio().wire) return;
      void dropWire(flow.screenToFlowPosition({ x: event.clientX, y: event.clientY }));
    };
    const leave = (event: KeyboardEvent) => {
      if (event.key !== "Escape" || !studio().wire) return;
      event.stopPropagation();
      endWire();
    };
    const add = () => {
      const box = document.getElementById("canvas")?.getBoundingClientRect() ?? new DOMRect();
      const screen = { x: box.left + box.width / 2 - 324, y: box.top + 120 };
      openPalette("", screen, flow.screenToFlowPosition({ x: box.left + box.width / 2, y: box.top + box.height / 2 }));
    };
    const note = () => {
      const box = document.getElementById("canvas")?.getBoundingClientRect() ?? new DOMRect();
      const place = flow.screenToFlowPosition({ x: box.left + box.width / 2 - 100, y: box.top + 96 });
      void addAnnotation({ kind: "note", at: [place.x, place.y] });
    };
    window.addEventListener("hfg-add", add);
    window.addEventListener("hfg-note", note);
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", up);
    window.addEventListener("keydown", leave, true);
    return () => {
      window.removeEventListener("hfg-add", add);
      window.removeEventListener("hfg-note", note);
      window.removeEventListener("pointermove", move);
      window.removeEventListener("pointerup", up);
      window.removeEventListener("keydown", leave, true);
    };
  }, [flow, spots]);

  return {
    onPointerDown(event: PointerEvent<HTMLElement>) {
      const port = (event.target as Element).closest<HTMLElement>("[data-port]");
      if (!port?.dataset.port || event.button !== 0 || layout?.view === "activity") return;
      event.preventDefault();
      event.stopPropagation();
      hideTip();
      const screen = { x: event.clientX, y: event.clientY };
      void beginWire(port.dataset.port, port.dataset.kind ?? "", flow.screenToFlowPosition(screen), screen);
    },
    onClick(event: MouseEvent<HTMLElement>) {
      const edge = edgeAt(event.target as Element);
      if (!edge) return;
      select([]);
      change({ selectedEdge: edge });
    },
    onDoubleClick(event: MouseEvent<HTMLElement>) {
      if (!(event.target as Element).classList.contains("react-flow__pane")) return;
      const screen = { x: event.clientX, y: event.clientY };
      openPalette("", screen, flow.screenToFlowPosition(screen));
    },
    onContextMenu(event: MouseEvent<HTMLElement>) {
      const target = event.target as Element;
      const node = target.closest<HTMLElement>("[data-node]")?.dataset.node;
      const edge = edgeAt(target);
      event.preventDefault();
      if (node && !studio().selection.has(node)) select([node]);
      if (edge) change({ selectedEdge: edge, selection: new Set() });
      change({ menu: { x: event.clientX, y: event.clientY, path: node ?? edge ?? "", kind: node ? "node" : edge ? "edge" : "canvas" } });
    },
    onPointerOver(event: PointerEvent<HTMLElement>) {
      const target = event.target as Element;
      highlight(target.closest<HTMLElement>("[data-node]")?.dataset.node);
      if (studio().wire || event.buttons !== 0) return;
      const element = target.closest<HTMLElement>("[data-port]");
      restOn(element?.dataset.port ?? "", element?.dataset.kind ?? "");
      const path = element?.dataset.port ?? edgeAt(target);
      if (path) showTip(path, event.clientX, event.clientY);
      else hideTip();
    },
    onPointerLeave() {
      highlight(undefined);
      hideTip();
    },
  };
}

function portAt(x: number, y: number): string | null {
  for (const element of document.elementsFromPoint(x, y)) {
    const port = element.closest<HTMLElement>("[data-port]")?.dataset.port;
    if (port) return port;
  }
  return null;
}

const edgeAt = (element: Element): string | undefined =>
  element.classList.contains("hit") ? element.closest<SVGGElement>("[data-edges]")?.dataset.edges?.split("\n")[0] : undefined;

let hovered: string | undefined;

/** The edges of the node under the mouse stay at full strength, all others step back. */
function highlight(node: string | undefined): void {
  if (node === hovered) return;
  hovered = node;
  for (const group of document.querySelectorAll<SVGGElement>("#canvas .wire-group")) {
    const touches = node !== undefined && group.dataset.ends?.split(" ").includes(node);
    group.classList.toggle("weak", node !== undefined && !touches);
    group.classList.toggle("strong", touches === true);
  }
}
