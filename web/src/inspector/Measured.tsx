import { useEffect, useRef, useState } from "react";
import { drawBars } from "../canvas/bars";
import { paintMeasures } from "../live/measures";
import type { NodeMeasures } from "../protocol/types";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { isRecording } from "../state/looking";
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
  const waits = Object.entries(facts?.waiting ?? {}).sort((a, b) => b[1] - a[1])[0];
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
      {facts?.doing && (
        <p className="second num" style={{ margin: "4px 0" }}>
          {facts.doing}
          {waits && waits[1] > 1 ? ` · waits for ${waits[0]}, for ${waits[1].toFixed(1)} s` : ""}
        </p>
      )}
    </div>
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
