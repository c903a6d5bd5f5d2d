import { ask, show } from "../state/actions";
import { useStudio } from "../state/studio";
import { nodeOf } from "../state/paths";
import { Icon } from "../ui/Icon";
import { clock } from "../ui/words";

/** Each problem leads to its node. */
export function ProblemList() {
  const problems = useStudio((s) => s.tables.problems);
  const nodes = useStudio((s) => s.tables.nodes);
  const list = Object.entries(problems).sort(([, a], [, b]) => rank(a.severity) - rank(b.severity));
  if (list.length === 0) return <p className="empty">No problems.</p>;
  return (
    <ul className="list">
      {list.map(([key, one]) => {
        const node = one.path in nodes ? one.path : nodeOf(one.path);
        return (
          <li key={key} className={one.severity === "error" ? "sel" : ""}>
            <span style={{ color: one.severity === "error" ? "var(--bad)" : "var(--warn)" }}>
              <Icon name="error" />
            </span>
            <span className="when">{one.at_s === null || one.at_s === undefined ? one.source : clock(one.at_s)}</span>
            <span className="path" title={one.path}>
              {one.path || "graph"}
            </span>
            <span className="what">
              {one.what} <span className="second">{[one.why, one.remedy].filter(Boolean).join(" ")}</span>
            </span>
            {(one.fixes ?? []).map((fix) => (
              <button type="button" key={fix.text} className="btn small line" onClick={() => void ask(fix.message)}>
                {fix.text}
              </button>
            ))}
            {node !== "" && node in nodes && (
              <button type="button" className="btn small line" onClick={() => show(node)}>
                Go to node
              </button>
            )}
          </li>
        );
      })}
    </ul>
  );
}

const rank = (severity: string): number => ["error", "warning", "hint"].indexOf(severity);
