import { useEffect, useRef } from "react";
import { paintMeasures } from "../live/measures";
import type { Measure } from "../protocol/frames";
import type { NodeBox } from "../protocol/types";
import { useWaits } from "../live/waits";
import { onTheme } from "../ui/colours";
import { duration, percent, rate } from "../ui/words";
import { drawBars } from "./bars";
import { isBig, isHelper } from "./NodeView";

interface Props {
  box: NodeBox;
  top: number;
  missing: string;
  failed: boolean;
  /** Why it does nothing; "" if it may. */
  off: "" | "disabled" | "muted";
}

const OF_ALL_INSIDE = "Bars: the busiest node inside. Then how busy all inside are together, and how often they fire.";

/** Bars, median and rate of a node. React draws them once; the figures are painted from outside of it. */
export function MeasureRow({ box, top, missing, failed, off }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const median = useRef<HTMLSpanElement>(null);
  const speed = useRef<HTMLSpanElement>(null);
  const extra = useRef<HTMLDivElement>(null);
  const helper = isHelper(box);
  const isSubgraph = box.kind === "subgraph";
  const wide = helper ? 56 : Math.min(isBig(box) ? 64 : 96, Math.max(40, box.width - 136));
  const tall = helper ? 14 : 16;

  useEffect(() => {
    if (missing !== "" || off !== "") return;
    let last: Measure | null = null;
    const paint = (measure: Measure, slow: boolean) => {
      last = measure;
      if (canvas.current) drawBars(canvas.current, measure);
      if (!slow) return;
      if (median.current) median.current.textContent = measure.bars.length === 0 ? "–" : isSubgraph ? percent(measure.busyShare) : duration(measure.median);
      if (speed.current) speed.current.textContent = measure.rate > 0.05 ? rate(measure.rate) : (SLOW[measure.state] ?? rate(0));
      if (extra.current) extra.current.textContent = more(measure, box.id);
    };
    if (canvas.current) drawBars(canvas.current, NOTHING);
    const stop = paintMeasures(box.id, paint);
    const unlisten = onTheme(() => last && paint(last, true));
    const unwait = useWaits.subscribe(() => last && paint(last, true));
    return () => {
      stop();
      unlisten();
      unwait();
    };
  }, [box.id, isSubgraph, missing, off]);

  if (missing !== "") {
    return (
      <div className="m" style={{ top }} title={missing}>
        not installed
      </div>
    );
  }
  if (off !== "") {
    return (
      <div className="m" style={{ top }}>
        {off}
      </div>
    );
  }
  return (
    <>
      {!helper && <div className="xtra num" ref={extra} />}
      <div className="m num" style={{ top }} title={isSubgraph ? OF_ALL_INSIDE : undefined}>
        <canvas ref={canvas} width={wide * 2} height={tall * 2} style={{ width: wide, height: tall }} />
        <span className="sp" />
        {failed ? <span className="fail">failed</span> : !helper && <span ref={median}>–</span>}
        <span ref={speed} style={helper ? undefined : { minWidth: 42, textAlign: "right" }}>
          idle
        </span>
      </div>
    </>
  );
}

/** What a node does that has no rate to speak of. */
const SLOW: Partial<Record<Measure["state"], string>> = { working: "works", ended: "ended" };

const NOTHING: Measure = { state: "idle", active: false, bars: new Float32Array(), count: 0, median: 0, p99: 0, rate: 0, activeShare: 0, busyShare: 0 };

function more(measure: Measure, path: string): string {
  const parts = measure.count === 0 ? ["has not fired yet"] : [`99 % ${duration(measure.p99)}`, `active ${percent(measure.activeShare)}`];
  const waits = useWaits.getState().nodes[path];
  if (waits) parts.push(waits[0]);
  return parts.join(" · ");
}
