import type { Data } from "../../protocol/types";
import { newGesture } from "../../state/actions";
import { short } from "../../ui/words";
import type { WidgetProps } from "../Field";

export function Choice({ id, type, value, off, bad, set }: WidgetProps) {
  const options: Data[] = type.labels.length > 0 ? type.labels : (type.choices ?? []);
  const index = options.findIndex((one) => JSON.stringify(one) === JSON.stringify(value));
  return (
    <div className={`fld wide${bad ? " bad-field" : ""}${off ? " locked" : ""}`}>
      <select id={id} value={index} disabled={off} onChange={(event) => set(options[Number(event.target.value)] ?? null, newGesture())}>
        {index < 0 && <option value={-1}>{short(value)}</option>}
        {options.map((one, at) => (
          <option key={short(one)} value={at}>
            {short(one)}
          </option>
        ))}
      </select>
    </div>
  );
}
