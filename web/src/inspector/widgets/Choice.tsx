import type { Data } from "../../protocol/types";
import { newGesture } from "../../state/actions";
import { said, short } from "../../ui/words";
import type { WidgetProps } from "../Field";

/** One of several values; what may be nothing has that among them. */
export function Choice({ id, type, value, off, bad, set }: WidgetProps) {
  const given: Data[] = type.labels.length > 0 ? type.labels : (type.choices ?? [true, false]);
  const options: Data[] = type.optional && !given.includes(null) ? [null, ...given] : given;
  const index = options.findIndex((one) => JSON.stringify(one) === JSON.stringify(value));
  return (
    <div className={`fld wide${bad ? " bad-field" : ""}${off ? " locked" : ""}`}>
      <select id={id} value={index} disabled={off} onChange={(event) => set(options[Number(event.target.value)] ?? null, newGesture())}>
        {index < 0 && <option value={-1}>{short(value)}</option>}
        {options.map((one, at) => (
          <option key={short(one)} value={at}>
            {said(one)}
          </option>
        ))}
      </select>
    </div>
  );
}
