import type { Data } from "../../protocol/types";
import { newGesture } from "../../state/actions";
import { short } from "../../ui/words";
import type { WidgetProps } from "../Field";
import { Plain } from "./Plain";

const MOST = 6;

/** A few numbers, each in a field of its own; more of them are written as a list. */
export function Numbers(props: WidgetProps) {
  const { id, type, value, off, bad, set } = props;
  if (!Array.isArray(value) || value.length === 0 || value.length > MOST || value.some((one) => typeof one !== "number")) return <Plain {...props} />;
  const commit = (at: number, text: string) => {
    const next = Number(text.replace(",", "."));
    if (text.trim() === "" || !Number.isFinite(next) || next === value[at]) return;
    set(value.map((one, index): Data => (index === at ? next : one)), newGesture());
  };
  return (
    <div className="numbers" role="group" aria-label={type.name.replaceAll("_", " ")}>
      {value.map((one, at) => (
        <div className={`fld${bad ? " bad-field" : ""}${off ? " locked" : ""}`} key={`${at} ${short(one)}`}>
          <input
            id={at === 0 ? id : undefined}
            aria-label={at === 0 ? undefined : `${type.name}, ${at + 1} of ${value.length}`}
            inputMode="decimal"
            defaultValue={short(one)}
            readOnly={off}
            onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
            onBlur={(event) => commit(at, event.target.value)}
          />
        </div>
      ))}
      {type.unit && <u>{type.unit}</u>}
    </div>
  );
}
