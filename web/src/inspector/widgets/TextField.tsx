import { newGesture } from "../../state/actions";
import type { WidgetProps } from "../Field";

export function TextField({ id, value, off, bad, set }: WidgetProps) {
  const text = typeof value === "string" ? value : value === null ? "" : String(value);
  return (
    <div className={`fld wide${bad ? " bad-field" : ""}${off ? " locked" : ""}`}>
      <input
        id={id}
        key={text}
        defaultValue={text}
        readOnly={off}
        onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
        onBlur={(event) => event.target.value !== text && set(event.target.value, newGesture())}
      />
    </div>
  );
}
