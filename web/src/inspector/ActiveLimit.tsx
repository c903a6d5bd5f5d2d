import { useEffect, useRef } from "react";
import { elapsed } from "../state/looking";
import { studio, useStudio } from "../state/studio";

/** How much of the time that a node may be active is over. */
export function ActiveLimit({ path, limit }: { path: string; limit: number }) {
  const active = useStudio((s) => path in s.activity.since);
  const bar = useRef<HTMLElement>(null);
  useEffect(() => {
    const paint = () => {
      const state = studio();
      const since = state.activity.since[path];
      const spent = since === undefined ? 0 : elapsed(state.tables.studio.run, state.clockOffset) - since;
      if (bar.current) bar.current.style.width = `${Math.min(100, Math.max(0, (spent / limit) * 100))}%`;
    };
    paint();
    if (!active) return;
    const timer = setInterval(paint, 250);
    return () => clearInterval(timer);
  }, [active, limit, path]);
  return (
    <div className="par">
      <label>active at most</label>
      <div className="sl">
        <i ref={bar} style={{ background: "var(--on)" }} />
      </div>
      <div className="fld locked">
        <input value={limit.toFixed(1)} aria-label="active at most" readOnly />
        <u>s</u>
      </div>
    </div>
  );
}
