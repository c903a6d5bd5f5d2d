import { redo, undo } from "../state/actions";
import { useStudio } from "../state/studio";

/** What was done and by whom: all who look share it. */
export function HistoryList() {
  const history = useStudio((s) => s.tables.studio.history);
  const me = useStudio((s) => s.hello?.viewer);
  const done = history?.done ?? [];
  const undone = history?.undone ?? [];
  const calls = history?.calls ?? [];
  if (done.length + undone.length + calls.length === 0) return <p className="empty">Nothing was changed yet. Everything that you change can be undone.</p>;
  return (
    <ul className="list">
      {[...undone].map((step) => (
        <li key={`u${step.n}`} className="undone">
          <span className="when">{time(step.at)}</span>
          <span className="what">{step.text}</span>
          {step === undone.at(-1) && (
            <button type="button" className="btn small line" onClick={() => void redo()}>
              Redo
            </button>
          )}
        </li>
      ))}
      {[...done, ...calls].sort((a, b) => b.at - a.at).map((step) => (
        <li key={step.n}>
          <span className="when">{time(step.at)}</span>
          <span className="what">{step.text}</span>
          <span className="muted">{step.by === me ? "you" : step.by === 0 ? "another program" : `viewer ${step.by}`}</span>
          {step.n === history?.saved && <span className="muted">saved</span>}
          {calls.includes(step) && <span className="muted">cannot be undone</span>}
          {step === done.at(-1) && (
            <button type="button" className="btn small line" onClick={() => void undo()}>
              Undo
            </button>
          )}
        </li>
      ))}
    </ul>
  );
}

const time = (at: number): string => new Date(at * 1000).toLocaleTimeString("en", { hour12: false });
