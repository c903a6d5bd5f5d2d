import { useEffect, useState } from "react";
import { useLoad } from "../live/load";
import { groupClass } from "../state/looking";
import { change, useStudio } from "../state/studio";
import { counted, moment, percent, plural } from "../ui/words";

export function StatusBar() {
  const nodes = useStudio((s) => Object.keys(s.tables.nodes).length);
  const edges = useStudio((s) => Object.keys(s.tables.edges).length);
  const viewers = useStudio((s) => s.tables.studio.viewers?.count ?? 1);
  const run = useStudio((s) => s.tables.studio.run);
  return (
    <footer id="status">
      <Problems />
      {run?.state === "ended" && <span className="num">run ended at {moment(run.elapsed_s)}</span>}
      <span className="num">
        <b>{counted(nodes)}</b> {nodes === 1 ? "node" : "nodes"} · <b>{counted(edges)}</b> {edges === 1 ? "edge" : "edges"}
      </span>
      <Loads />
      <span className="spring" />
      <Frames />
      {viewers > 1 && <span className="hide-n num">{viewers} people look</span>}
      <span>{location.host}</span>
    </footer>
  );
}

function Problems() {
  const count = useStudio((s) => Object.values(s.tables.problems).filter((one) => one.severity === "error").length);
  const go = () => change({ tab: "problems", time: true });
  if (count === 0) return null;
  return (
    <button type="button" className="btn small" style={{ color: "var(--bad)", fontWeight: 600 }} onClick={go}>
      {plural(count, "problem")}
    </button>
  );
}

function Loads() {
  const load = useLoad((s) => s.load);
  const tables = useStudio((s) => s.tables);
  if (!load) return null;
  return (
    <>
      <span className="num">
        <b>{counted(Math.round(load.firings_hz))}</b> firings/s
      </span>
      {Object.entries(load.groups).map(([name, one]) => (
        <span className="num" key={name}>
          <i className={`swatch ${groupClass(tables, name)}`} />
          {name} <b>{percent(one.busy_share)}</b> busy
        </span>
      ))}
    </>
  );
}

/** Frames a second, counted over two seconds. */
function Frames() {
  const [rate, setRate] = useState<number | null>(null);
  useEffect(() => {
    let frames = 0;
    let begin = performance.now();
    let request = requestAnimationFrame(function count() {
      frames++;
      const now = performance.now();
      if (now - begin >= 2000) {
        setRate(Math.round((frames * 1000) / (now - begin)));
        frames = 0;
        begin = now;
      }
      request = requestAnimationFrame(count);
    });
    return () => cancelAnimationFrame(request);
  }, []);
  return rate === null ? null : <span className="hide-n num">page {rate} fps</span>;
}
