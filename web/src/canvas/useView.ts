import { useReactFlow, useStoreApi, type Viewport } from "@xyflow/react";
import { type RefObject, startTransition, useCallback, useEffect, useMemo, useRef, useState } from "react";
import { create } from "zustand";
import type { LayoutRecord } from "../protocol/types";
import { studio } from "../state/studio";
import { allInView, type Box, boundsOf, clearOf, firstView, type Zoom, zoomOf } from "./geometry";

/** Which of the three ways to draw the zoom asks for. */
export const useZoom = create<{ level: Zoom }>()(() => ({ level: "middle" }));

const kept = new Map<string, Viewport>();
const still = window.matchMedia("(prefers-reduced-motion: reduce)");

/** Where one looks: place and zoom of each level are kept; which of the three ways to draw follows the zoom. */
export function useView(root: RefObject<HTMLElement | null>, layout: LayoutRecord | undefined) {
  const flow = useReactFlow();
  const level = useZoom((s) => s.level);
  const [partly, setPartly] = useState(false);
  const shown = useRef<string | null>(null);
  const seen = useRef(0);
  const settled = useRef(0);
  const current = useRef(layout);
  current.current = layout;

  const settle = useCallback(
    (view: Viewport) => {
      const element = root.current;
      if (!element || settled.current === view.zoom) return;
      settled.current = view.zoom;
      const next = zoomOf(view.zoom);
      // A variable is computed anew for all that is below, so it is set where and when something depends on it only.
      if (next === "near") element.style.setProperty("--inv", String(1 / view.zoom));
      if (next === "far") element.querySelector<HTMLElement>(".under")?.style.setProperty("--z", String(view.zoom));
      useZoom.setState({ level: next });
    },
    [root],
  );

  const onMove = useCallback((_: unknown, view: Viewport) => settle(view), [settle]);
  /** How the view was chosen for the person, who has not moved it since: it then follows the size of the window. */
  const chosen = useRef<"first" | "all" | null>(null);
  const onMoveEnd = useCallback(
    (_: unknown, view: Viewport) => {
      if (!isSame(view, own.current)) {
        chosen.current = null;
        kept.set(key(current.current), view);
      }
      setPartly(isPartly(current.current, view, root.current));
    },
    [root],
  );
  const own = useRef<Viewport | null>(null);
  const fit = useCallback(
    (how: "first" | "all", duration: number) => {
      const element = root.current;
      if (!element || !current.current) return;
      const view = clearOf(how === "all" ? allInView : firstView, current.current, element.clientWidth, element.clientHeight);
      chosen.current = how;
      own.current = view;
      void flow.setViewport(view, { duration });
      if (duration > 0) return;
      settle(view);
      setPartly(isPartly(current.current, view, element));
    },
    [flow, root, settle],
  );

  const showAll = useCallback(() => {
    kept.delete(key(current.current));
    fit("all", still.matches ? 0 : 200);
  }, [fit]);

  useEffect(() => {
    const element = root.current;
    if (!element) return;
    const observer = new ResizeObserver(() => chosen.current !== null && fit(chosen.current, 0));
    observer.observe(element);
    return () => observer.disconnect();
  }, [fit, root]);

  useEffect(() => {
    const element = root.current;
    if (!layout || !element) return;
    const count = seen.current;
    seen.current = layout.nodes.length;
    // A graph that is opened may come after its name; a first node that is added stays where it was put.
    const comes = count === 0 && layout.nodes.length > 1 && chosen.current !== null;
    if (shown.current === key(layout) && !comes) return;
    shown.current = key(layout);
    const view = kept.get(key(layout));
    if (!view) {
      fit(layout.deep ? "all" : "first", 0);
      return;
    }
    chosen.current = null;
    void flow.setViewport(view);
    settle(view);
    setPartly(isPartly(layout, view, element));
  }, [layout, flow, root, settle, fit]);

  /** A node that is to be seen, as soon as it has a place. */
  const wanted = useRef("");
  const come = useCallback(() => {
    const box = current.current?.nodes.find((one) => one.id === wanted.current);
    const element = root.current;
    if (!box || !element) return;
    wanted.current = "";
    const view = flow.getViewport();
    const [x, y] = [box.x * view.zoom + view.x, box.y * view.zoom + view.y];
    const inside = x > 0 && y > 0 && x + box.width * view.zoom < element.clientWidth && y + box.height * view.zoom < element.clientHeight;
    if (!inside) void flow.setCenter(box.x + box.width / 2, box.y + box.height / 2, { zoom: Math.max(view.zoom, 0.6), duration: still.matches ? 0 : 200 });
  }, [flow, root]);

  useEffect(() => {
    const reveal = (event: Event) => {
      wanted.current = (event as CustomEvent<string>).detail;
      setTimeout(come, 60);
    };
    window.addEventListener("hfg-show", reveal);
    window.addEventListener("hfg-show-all", showAll);
    return () => {
      window.removeEventListener("hfg-show", reveal);
      window.removeEventListener("hfg-show-all", showAll);
    };
  }, [come, showAll]);

  useEffect(come, [layout, come]);

  return { level, partly, onMove, onMoveEnd, showAll };
}

const AFTERWARDS_MS = 60;

/** The part of a level that is in sight as it comes on the screen; null soon after, when all of it is to be drawn. */
export function useSight(layout: LayoutRecord): Box | null {
  const flow = useStoreApi();
  const place = key(layout);
  const [whole, setWhole] = useState("");
  useEffect(() => {
    if (whole === place) return;
    const timer = setTimeout(() => startTransition(() => setWhole(place)), AFTERWARDS_MS);
    return () => clearTimeout(timer);
  }, [place, whole]);
  return useMemo(() => {
    const { width, height } = flow.getState();
    if (whole === place || width === 0) return null;
    const view = kept.get(place) ?? clearOf(layout.deep ? allInView : firstView, layout, width, height);
    return { x: -view.x / view.zoom, y: -view.y / view.zoom, width: width / view.zoom, height: height / view.zoom };
  }, [flow, layout, place, whole]);
}

const isSame = (a: Viewport, b: Viewport | null): boolean =>
  b !== null && Math.abs(a.x - b.x) < 1 && Math.abs(a.y - b.y) < 1 && Math.abs(a.zoom - b.zoom) < 0.001;

const key = (layout: LayoutRecord | undefined): string => (layout ? `${studio().tables.studio.file?.graph}:${studio().tables.studio.file?.path}:${studio().level}:${layout.view}:${layout.deep}` : "");

function isPartly(layout: LayoutRecord | undefined, view: Viewport, element: HTMLElement | null): boolean {
  if (!layout || !element) return false;
  const box = boundsOf(layout);
  const [left, top] = [view.x + box.x * view.zoom, view.y + box.y * view.zoom];
  const [right, bottom] = [left + box.width * view.zoom, top + box.height * view.zoom];
  return left < -40 || top < -40 || right > element.clientWidth + 40 || bottom > element.clientHeight + 40;
}
