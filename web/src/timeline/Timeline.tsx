import { type PointerEvent, useEffect, useRef, type WheelEvent } from "react";
import { seek } from "../live/replay";
import { show, select } from "../state/actions";
import { parentOf } from "../state/paths";
import { studio, useStudio } from "../state/studio";
import { drawTimeline, GUTTER, overviewTimeAt, scale, targets, timeAt } from "./draw";
import { givesWay } from "../ui/giving";
import { record, useWindow, watchTimeline } from "./store";

const LEAST_S = 0.02;
const OVERVIEW_PX = 26;

/** The whole run, activity as an icicle, and a lane for each group. What is selected here is selected in the graph. */
export function Timeline() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const run = useStudio((s) => s.tables.studio.run?.number ?? 0);
  const drag = useRef<{ x: number; end: number; moved: boolean; overview: boolean } | null>(null);

  useEffect(() => watchTimeline(run), [run]);
  useEffect(() => {
    if (canvas.current) drawTimeline(canvas.current, true);
    let painted = performance.now();
    let request = requestAnimationFrame(function frame() {
      if (canvas.current && (record.cursor !== null || !givesWay(painted))) {
        drawTimeline(canvas.current);
        painted = performance.now();
      }
      if (canvas.current && record.cursor !== null) noteTimes(canvas.current);
      request = requestAnimationFrame(frame);
    });
    return () => cancelAnimationFrame(request);
  }, []);

  const place = (event: PointerEvent | WheelEvent) => {
    const box = event.currentTarget.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const wheel = (event: WheelEvent<HTMLCanvasElement>) => {
    const { x } = place(event);
    const across = event.shiftKey ? event.deltaY : event.deltaX;
    if (record.cursor !== null && across !== 0) {
      const end = scale.begin + scale.length * (1 + across / (scale.width - GUTTER));
      useWindow.setState({ follows: false, end: Math.min(Math.max(end, scale.length), Math.max(record.now, scale.length)) });
      return;
    }
    const length = Math.min(Math.max(LEAST_S, scale.length * Math.exp(event.deltaY * 0.0015)), Math.max(14, record.now));
    const { follows } = useWindow.getState();
    const at = timeAt(Math.max(GUTTER, x));
    const share = (at - scale.begin) / scale.length;
    useWindow.setState({ length, end: follows && record.cursor === null ? record.now : at + (1 - share) * length });
  };
  const down = (event: PointerEvent<HTMLCanvasElement>) => {
    const { x, y } = place(event);
    event.currentTarget.setPointerCapture(event.pointerId);
    drag.current = { x, end: scale.begin + scale.length, moved: false, overview: y < OVERVIEW_PX };
    if (record.cursor !== null) scrub(x, y < OVERVIEW_PX);
  };
  const move = (event: PointerEvent<HTMLCanvasElement>) => {
    const begun = drag.current;
    if (!begun) return;
    const { x } = place(event);
    if (!begun.moved && Math.abs(x - begun.x) < 4) return;
    begun.moved = true;
    if (record.cursor !== null) {
      scrub(x, begun.overview);
      return;
    }
    if (begun.overview) {
      const middle = overviewTimeAt(x);
      useWindow.setState({ follows: false, end: Math.min(record.now, middle + scale.length / 2) });
      return;
    }
    const seconds = ((begun.x - x) / (scale.width - GUTTER)) * scale.length;
    useWindow.setState({ follows: false, end: Math.min(Math.max(begun.end + seconds, scale.length), Math.max(record.now, scale.length)) });
  };
  const up = (event: PointerEvent<HTMLCanvasElement>) => {
    const begun = drag.current;
    drag.current = null;
    if (!begun || begun.moved) return;
    const { x, y } = place(event);
    const hit = targets.findLast((one) => x >= one.x - 1 && x <= one.x + one.width + 1 && y >= one.y && y <= one.y + one.height);
    if (hit) choose(hit.path, event.detail > 1 || event.ctrlKey);
  };
  return (
    <canvas
      ref={canvas}
      tabIndex={0}
      role="img"
      aria-label="Timeline: the whole run, its activity, and a lane of firings for each group"
      onWheel={wheel}
      onPointerDown={down}
      onPointerMove={move}
      onPointerUp={up}
    />
  );
}

/** What the picture says, for those who do not see it, and for tests. */
function noteTimes(canvas: HTMLCanvasElement): void {
  canvas.dataset.cursor = String(+(record.cursor ?? 0).toFixed(3));
  canvas.dataset.length = String(+record.now.toFixed(3));
}

/** Puts the cursor of a recording where the mouse is; from the overview, with the window around it. */
function scrub(x: number, overview: boolean): void {
  const at = overview ? overviewTimeAt(x) : timeAt(Math.max(GUTTER, x));
  const end = Math.min(Math.max(at + scale.length / 2, scale.length), Math.max(record.now, scale.length));
  if (overview) useWindow.setState({ end });
  seek(at);
}

/** Nothing jumps unless asked: a node elsewhere is selected there, and marked on the subgraph around it here. */
function choose(path: string, go: boolean): void {
  const { tables, level } = studio();
  if (!(path in tables.nodes)) return;
  if (go) show(path);
  else {
    select([path]);
    if (parentOf(path) === level) window.dispatchEvent(new CustomEvent("hfg-show", { detail: path }));
  }
}
