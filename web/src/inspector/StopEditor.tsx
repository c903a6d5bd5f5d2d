import { useState } from "react";
import { Refusal } from "../protocol/socket";
import { socket } from "../state/link";
import { locked } from "../state/actions";
import { useStudio } from "../state/studio";
import { useAnswer } from "../state/useAnswer";
import type { Data } from "../protocol/types";

interface Stops {
  comparisons: string[];
  parts: string[];
}

/** A breakpoint, and where something is sent also when it holds. */
export function StopEditor({ path }: { path: string }) {
  const stops = useAnswer<Stops>("stops", { path });
  const set = useStudio((s) => s.tables.breakpoints[path]);
  const off = useStudio((s) => s.age === 3) || locked() !== "";
  const [refusal, setRefusal] = useState("");
  const say = (t: string, more: Record<string, unknown> = {}) =>
    socket.request({ t, path, ...more }).then(
      () => setRefusal(""),
      (error: Error) => setRefusal(error instanceof Refusal ? error.reject.message : error.message),
    );
  const when = set?.when ?? null;
  return (
    <div className="sec">
      <h3>
        Breakpoint<span className="sp" />
        <small>{set && set.hits > 0 ? `held ${set.hits === 1 ? "once" : `${set.hits} times`}` : ""}</small>
      </h3>
      <div className="par">
        <label htmlFor="stops-here">pauses here</label>
        <input id="stops-here" type="checkbox" checked={set !== undefined} disabled={off} onChange={(event) => void say(event.target.checked ? "break" : "unbreak")} />
      </div>
      {set && stops && stops.comparisons.length > 0 && (
        <When key={JSON.stringify(when)} stops={stops} when={when} off={off} put={(condition) => void say("break", { condition })} />
      )}
      {set && set.why_not !== "" && <p className="par-note">The last value could not be compared: {set.why_not}</p>}
      {refusal !== "" && (
        <p className="par-note" role="alert">
          {refusal}
        </p>
      )}
    </div>
  );
}

interface Condition {
  op: string;
  value: Data;
  field: string;
}

function When({ stops, when, off, put }: { stops: Stops; when: Partial<Condition> | null; off: boolean; put: (one: Condition | null) => void }) {
  const [op, setOp] = useState(when?.op ?? stops.comparisons[0] ?? "");
  const [field, setField] = useState(when?.field ?? "");
  const [value, setValue] = useState(when ? JSON.stringify(when.value ?? null) : "");
  const commit = (next: string) => {
    if (next.trim() === "") {
      if (when) put(null);
      return;
    }
    put({ op, field, value: valueOf(next) });
  };
  return (
    <form
      className="when"
      onSubmit={(event) => {
        event.preventDefault();
        commit(value);
      }}
    >
      <label htmlFor="when-part">only if</label>
      <div className="fld">
        <input id="when-part" list="when-parts" placeholder="value" readOnly={off} value={field} onChange={(event) => setField(event.target.value)} title="The value, or a part of it: pose.x, 0.name" />
        <datalist id="when-parts">
          {stops.parts.map((one) => (
            <option key={one} value={one} />
          ))}
        </datalist>
      </div>
      <div className="fld">
        <select aria-label="comparison" value={op} disabled={off} onChange={(event) => setOp(event.target.value)}>
          {stops.comparisons.map((one) => (
            <option key={one} value={one}>
              {one}
            </option>
          ))}
        </select>
      </div>
      <div className="fld">
        <input aria-label="compared with" placeholder="anything" readOnly={off} value={value} onChange={(event) => setValue(event.target.value)} />
      </div>
      <button type="submit" className="btn line" disabled={off}>
        Set
      </button>
    </form>
  );
}

function valueOf(text: string): Data {
  try {
    return JSON.parse(text) as Data;
  } catch {
    return text;
  }
}
