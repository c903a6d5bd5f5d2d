import type { Data } from "../../protocol/types";
import { newGesture } from "../../state/actions";
import { short } from "../../ui/words";
import type { WidgetProps } from "../Field";

/** Several of several values, each with a box of its own. */
export function Choices({ id, type, value, off, set }: WidgetProps) {
  const options: Data[] = type.labels.length > 0 ? type.labels : (type.choices ?? []);
  const chosen = new Set((Array.isArray(value) ? value : []).map((one) => JSON.stringify(one)));
  const toggle = (one: Data, on: boolean) => {
    const key = JSON.stringify(one);
    set(
      options.filter((other) => (JSON.stringify(other) === key ? on : chosen.has(JSON.stringify(other)))),
      newGesture(),
    );
  };
  return (
    <fieldset className="choices" aria-label={type.name.replaceAll("_", " ")}>
      {options.map((one, at) => (
        <label key={short(one)}>
          <input id={at === 0 ? id : undefined} type="checkbox" checked={chosen.has(JSON.stringify(one))} disabled={off} onChange={(event) => toggle(one, event.target.checked)} />
          {short(one)}
        </label>
      ))}
    </fieldset>
  );
}
