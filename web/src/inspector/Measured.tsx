import { useEffect, useRef, useState } from "react";
import { drawBars } from "../canvas/bars";
import { paintMeasures } from "../live/measures";
import type { NodeMeasures } from "../protocol/types";
import { socket } from "../state/link";
import { useWaits } from "../live/waits";
import { elapsed, isRecording } from "../state/looking";
import { studio, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { counted, duration } from "../ui/words";

export function Measured({ path }: { path: string }) {
  const [facts, setFacts] = useState<NodeMeasures | null>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const isSubgraph = useStudio((s) => s.tables.nodes[path]?.subgraph ?? false);
  const runs = useStudio((s) => s.tables.studio.run?.state !== "rest" && !isRecording(s.tables.studio.run));

  useEffect(() => {
    setFacts(null);
    const subscription = socket.subscribe("node", { path }, 4, (value) => setFacts(value as NodeMeasures));
    const stop = paintMeasures(path, (measure) => canvas.current && drawBars(canvas.current, measure));
    return () => {
      subscription.end();
      stop();
    };
  }, [path]);

  if (!runs || isSubgraph) return null;
  return (
    <div className="sec">
      <h3>
        Measured<span className="sp" />
        <small>since 0.0 s</small>
      </h3>
      <canvas ref={canvas} width={592} height={64} style={{ width: "100%", height: 32, display: "block" }} />
      <dl className="facts num" style={{ margin: "6px 0 4px" }}>
        <Fact name="firings" value={facts ? counted(facts.firings) : "–"} />
        <Fact name="calls" value={facts ? counted(facts.calls) : "–"} />
        <Fact name="median" value={duration(facts?.p50_s)} />
        <Fact name="99 %" value={duration(facts?.p99_s)} />
      </dl>
      <Waiting path={path} />
    </div>
  );
}

/** What the node waits for, and for how long at least: the studio looks twice a second. */
function Waiting({ path }: { path: string }) {
  const wait = useWaits((s) => s.nodes[path]);
  const text = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    if (!wait) return;
    const paint = () => {
      const state = studio();
      const spent = Math.max(0, elapsed(state.tables.studio.run, state.clockOffset) - wait[1]);
      if (text.current) text.current.textContent = `${wait[0]}, for at least ${spent.toFixed(1)} s`;
    };
    paint();
    const timer = setInterval(paint, 250);
    return () => clearInterval(timer);
  }, [wait]);
  if (!wait) return null;
  return (
    <p className="second num row" style={{ margin: "4px 0", gap: 6 }}>
      <Icon name="hourglass" />
      <span ref={text} />
    </p>
  );
}

function Fact({ name, value }: { name: string; value: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}
