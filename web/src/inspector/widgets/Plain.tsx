import { newGesture } from "../../state/actions";
import type { Data } from "../../protocol/types";
import type { WidgetProps } from "../Field";

/** Any other kind, as data: lists, intervals, records. A trigger is a button. */
export function Plain({ id, type, value, off, bad, set }: WidgetProps) {
  if (type.kind === "trigger") {
    return (
      <button id={id} type="button" className="btn line" disabled={off} onClick={() => set(true, newGesture())}>
        {type.name}
      </button>
    );
  }
  if (type.kind === "progress") return <progress id={id} value={typeof value === "number" ? value : 0} max={1} />;
  const text = JSON.stringify(value);
  const commit = (next: string) => {
    if (next === text) return;
    set(parsed(next), newGesture());
  };
  return (
    <div className={`fld wide${bad ? " bad-field" : ""}${off ? " locked" : ""}`}>
      <input
        id={id}
        className="mono"
        key={text}
        defaultValue={text}
        readOnly={off}
        onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
        onBlur={(event) => commit(event.target.value)}
      />
    </div>
  );
}

/** What is no data is sent as the text that it is: the studio says what it expects. */
function parsed(text: string): Data {
  try {
    return JSON.parse(text) as Data;
  } catch {
    return text;
  }
}
