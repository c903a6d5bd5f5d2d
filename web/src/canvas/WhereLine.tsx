import { useEffect, useRef } from "react";
import { elapsed, limitOf } from "../state/looking";
import { below } from "../state/paths";
import { studio, useStudio } from "../state/studio";

/** Where inside an active folded subgraph the activity is, and how long it may stay there. */
export function WhereLine({ path, inside, top }: { path: string; inside: string; top: number }) {
  const limit = useStudio((s) => limitOf(s.tables.nodes[inside]));
  const fill = useRef<HTMLElement>(null);
  const text = useRef<HTMLSpanElement>(null);

  useEffect(() => {
    const paint = () => {
      const state = studio();
      const since = state.activity.since[inside];
      if (since === undefined) return;
      const spent = Math.max(0, elapsed(state.tables.studio.run, state.clockOffset) - since);
      if (text.current) text.current.textContent = limit === null ? `${spent.toFixed(1)} s` : `${spent.toFixed(1)} of ${limit.toFixed(1)} s`;
      if (fill.current && limit !== null) fill.current.style.width = `${Math.min(100, (spent / limit) * 100)}%`;
    };
    paint();
    const timer = setInterval(paint, 250);
    return () => clearInterval(timer);
  }, [inside, limit]);

  const words = below(inside, path).split(" › ").slice(-2).join(" › ");
  return (
    <div className="within-line" style={{ top }}>
      <i className="dot" />
      <span>{words}</span>
      {limit === null ? (
        <span className="sp" style={{ flex: 1 }} />
      ) : (
        <span className="lim">
          <i ref={fill} />
        </span>
      )}
      <span className="num" ref={text} />
    </div>
  );
}
