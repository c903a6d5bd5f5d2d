import { useReactFlow, type Viewport } from "@xyflow/react";
import { type RefObject, useCallback, useEffect, useRef, useState } from "react";
import type { LayoutRecord } from "../protocol/types";
import { studio } from "../state/studio";
import { allInView, firstView, type Zoom, zoomOf } from "./geometry";

const kept = new Map<string, Viewport>();
const still = window.matchMedia("(prefers-reduced-motion: reduce)");

/** Where one looks: place and zoom of each level are kept; which of the three ways to draw follows the zoom. */
export function useView(root: RefObject<HTMLElement | null>, layout: LayoutRecord | undefined) {
  const flow = useReactFlow();
  const [level, setLevel] = useState<Zoom>("middle");
  const [zoom, setZoom] = useState(1);
  const [partly, setPartly] = useState(false);
  const shown = useRef<string | null>(null);
  const current = useRef(layout);
  current.current = layout;

  const settle = useCallback(
    (view: Viewport) => {
      const element = root.current;
      if (!element) return;
      element.style.setProperty("--z", String(view.zoom));
      element.style.setProperty("--inv", String(1 / view.zoom));
      setLevel(zoomOf(view.zoom));
      setZoom(view.zoom);
    },
    [root],
  );

  const onMove = useCallback((_: unknown, view: Viewport) => settle(view), [settle]);
  const onMoveEnd = useCallback(
    (_: unknown, view: Viewport) => {
      kept.set(key(current.current), view);
      setPartly(isPartly(current.current, view, root.current));
    },
    [root],
  );

  const showAll = useCallback(() => {
    const element = root.current;
    if (!element || !current.current) return;
    const view = allInView(current.current.width, current.current.height, element.clientWidth, element.clientHeight);
    void flow.setViewport(view, { duration: still.matches ? 0 : 200 });
  }, [flow, root]);

  useEffect(() => {
    const element = root.current;
    if (!layout || !element || shown.current === key(layout)) return;
    shown.current = key(layout);
    const view = kept.get(key(layout)) ?? firstView(layout.width, layout.height, element.clientWidth, element.clientHeight);
    void flow.setViewport(view);
    settle(view);
    setPartly(isPartly(layout, view, element));
  }, [layout, flow, root, settle]);

  useEffect(() => {
    const reveal = (event: Event) => {
      const path = (event as CustomEvent<string>).detail;
      setTimeout(() => centre(path), 60);
    };
    const centre = (path: string) => {
      const box = current.current?.nodes.find((one) => one.id === path);
      const element = root.current;
      if (!box || !element) return;
      const view = flow.getViewport();
      const [x, y] = [box.x * view.zoom + view.x, box.y * view.zoom + view.y];
      const inside = x > 0 && y > 0 && x + box.width * view.zoom < element.clientWidth && y + box.height * view.zoom < element.clientHeight;
      if (!inside) void flow.setCenter(box.x + box.width / 2, box.y + box.height / 2, { zoom: Math.max(view.zoom, 0.6), duration: still.matches ? 0 : 200 });
    };
    const fit = () => showAll();
    window.addEventListener("hfg-show", reveal);
    window.addEventListener("hfg-show-all", fit);
    return () => {
      window.removeEventListener("hfg-show", reveal);
      window.removeEventListener("hfg-show-all", fit);
    };
  }, [flow, root, showAll]);

  return { level, zoom, partly, onMove, onMoveEnd, showAll };
}

const key = (layout: LayoutRecord | undefined): string => (layout ? `${studio().hello?.name}:${studio().level}:${layout.view}` : "");

function isPartly(layout: LayoutRecord | undefined, view: Viewport, element: HTMLElement | null): boolean {
  if (!layout || !element) return false;
  const [left, top] = [view.x, view.y];
  const [right, bottom] = [view.x + layout.width * view.zoom, view.y + layout.height * view.zoom];
  return left < -40 || top < -40 || right > element.clientWidth + 40 || bottom > element.clientHeight + 40;
}
