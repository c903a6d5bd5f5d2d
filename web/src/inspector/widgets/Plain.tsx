import { useState } from "react";
import { newGesture } from "../../state/actions";
import type { Data } from "../../protocol/types";
import type { WidgetProps } from "../Parameter";

/** Any other kind, as data: lists, intervals, records. A trigger is a button. */
export function Plain({ id, type, value, off, bad, set }: WidgetProps) {
  const [wrong, setWrong] = useState(false);
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
    try {
      set(JSON.parse(next) as Data, newGesture());
      setWrong(false);
    } catch {
      setWrong(true);
    }
  };
  return (
    <div className={`fld wide${bad || wrong ? " bad-field" : ""}${off ? " locked" : ""}`}>
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
