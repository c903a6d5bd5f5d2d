import { useLoad } from "../live/load";
import { dropToast, holdToast } from "../state/actions";
import { socket } from "../state/link";
import { elapsed } from "../state/looking";
import { useStudio, type Toast } from "../state/studio";
import { Icon } from "../ui/Icon";
import { moment } from "../ui/words";

export function Toasts() {
  const toasts = useStudio((s) => s.toasts);
  return (
    <div className="toasts" role="status">
      <Away />
      {toasts.map((one) => (
        <OneToast key={one.id} toast={one} />
      ))}
    </div>
  );
}

function OneToast({ toast }: { toast: Toast }) {
  const hold = (held: boolean) => () => holdToast(toast.id, held);
  const held = { onPointerEnter: hold(true), onPointerLeave: hold(false), onFocus: hold(true), onBlur: hold(false) };
  return (
    <div className={`pop toast grows ${toast.kind === "bad" ? "bad" : ""}`} role={toast.kind === "bad" ? "alert" : undefined} {...held}>
      {toast.kind !== "plain" && (
        <span style={{ color: toast.kind === "bad" ? "var(--bad)" : "var(--warn)" }}>
          <Icon name="error" />
        </span>
      )}
      <span>
        {toast.title !== "" && <b>{toast.title} </b>}
        {toast.text}
      </span>
      {toast.action && (
        <button type="button" className="btn line" onClick={toast.action.act}>
          {toast.action.label}
        </button>
      )}
      <button type="button" className="btn" aria-label="Close" onClick={() => dropToast(toast.id)}>
        <Icon name="close" />
      </button>
    </div>
  );
}

const BUSY = 0.8;

/** The page says what it does not know. */
function Away() {
  const age = useStudio((s) => s.age);
  const seconds = useStudio((s) => s.ageSeconds);
  const phase = useStudio((s) => s.phase);
  const why = useStudio((s) => s.closedWhy);
  const run = useStudio((s) => s.tables.studio.run);
  const offset = useStudio((s) => s.clockOffset);
  const loop = useLoad((s) => s.load?.groups.loop?.busy_share ?? 0);
  if (phase === "refused") {
    return (
      <div className="pop toast bad" role="alert">
        <span style={{ color: "var(--bad)" }}>
          <Icon name="error" />
        </span>
        <span>
          <b>The studio does not let this page in.</b> {why || "Open the address that hfg studio has printed; it has the token."}
        </span>
      </div>
    );
  }
  if (age < 3) return null;
  return (
    <div className="pop toast" role="alert">
      <span style={{ color: "var(--warn)" }}>
        <Icon name="error" />
      </span>
      <span>
        <b>No word from the studio for {seconds} s.</b> {run ? `You see how it was at ${moment(Math.max(0, elapsed(run, offset) - seconds))}. ` : ""}Edits wait until it answers.
        {phase === "closed" && why !== "" && ` The studio says: ${why}.`}
        {run?.state === "running" && loop > BUSY && " The loop was busy: a node that computes for long holds up the studio, too. A thread of its own (in the inspector, group) helps."}
      </span>
      <button type="button" className="btn line" onClick={() => socket.connect()}>
        Try now
      </button>
    </div>
  );
}
