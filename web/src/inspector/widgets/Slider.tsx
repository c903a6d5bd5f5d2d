import { type KeyboardEvent, type PointerEvent, useRef, useState } from "react";
import { newGesture } from "../../state/actions";
import type { WidgetProps } from "../Field";
import { digits, niceStep, rangeOf, tidy } from "./range";

/** At most so many values a second are sent while one drags; all of them are one step of the history. */
const EVERY_MS = 33;

/** A number: drag, arrow keys (Shift 10 steps, Alt a tenth), or type; a tick at the default. */
export function Slider({ id, type, value, off, bad, set }: WidgetProps) {
  const number = typeof value === "number" ? value : 0;
  const [drag, setDrag] = useState<number | null>(null);
  const [text, setText] = useState<string | null>(null);
  const gesture = useRef("");
  const sent = useRef(0);
  const [low, high] = rangeOf(type, number);
  const step = type.step ?? (type.kind === "int" ? 1 : niceStep(high - low));
  const shown = drag ?? number;

  const send = (next: number, last: boolean) => {
    const now = performance.now();
    if (!last && now - sent.current < EVERY_MS) return;
    sent.current = now;
    set(next, gesture.current);
  };
  const at = (event: PointerEvent<HTMLDivElement>) => {
    const box = event.currentTarget.getBoundingClientRect();
    const share = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    return tidy(low + share * (high - low), step, type.kind === "int");
  };
  const down = (event: PointerEvent<HTMLDivElement>) => {
    if (off) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    gesture.current = newGesture();
    setDrag(at(event));
    send(at(event), false);
  };
  const move = (event: PointerEvent<HTMLDivElement>) => {
    if (drag === null) return;
    setDrag(at(event));
    send(at(event), false);
  };
  const up = (event: PointerEvent<HTMLDivElement>) => {
    if (drag === null) return;
    send(at(event), true);
    setDrag(null);
  };
  const key = (event: KeyboardEvent<HTMLInputElement>) => {
    if (event.key === "Enter") commit();
    if (event.key === "Escape") setText(null);
    if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
    event.preventDefault();
    const by = step * (event.shiftKey ? 10 : event.altKey ? 0.1 : 1) * (event.key === "ArrowUp" ? 1 : -1);
    if (!event.repeat) gesture.current = newGesture();
    set(tidy(number + by, Math.abs(by), type.kind === "int"), gesture.current);
    setText(null);
  };
  const commit = () => {
    if (text === null) return;
    const next = Number(text.replace(",", "."));
    setText(null);
    if (type.optional && text.trim() === "" && value !== null) set(null, newGesture());
    if (text.trim() !== "" && Number.isFinite(next) && (next !== number || value === null)) set(next, newGesture());
  };
  const share = (one: number) => `${Math.min(100, Math.max(0, ((one - low) / (high - low || 1)) * 100))}%`;
  return (
    <>
      <div className="sl range" onPointerDown={down} onPointerMove={move} onPointerUp={up} data-slider={type.name}>
        <i style={{ width: share(shown) }} />
        {typeof type.default === "number" && <s style={{ left: share(type.default) }} />}
        {(drag !== null || value !== null) && <u style={{ left: share(shown) }} />}
      </div>
      <div className={`fld${bad ? " bad-field" : ""}${off ? " locked" : ""}`}>
        <input
          id={id}
          inputMode="decimal"
          readOnly={off}
          placeholder={type.optional ? "none" : undefined}
          value={text ?? (drag === null && value === null ? "" : digits(shown, step, type.kind === "int"))}
          onChange={(event) => setText(event.target.value)}
          onKeyDown={key}
          onBlur={commit}
        />
        {type.unit && <u>{type.unit}</u>}
      </div>
    </>
  );
}
