import { newGesture } from "../../state/actions";
import type { Data } from "../../protocol/types";
import type { WidgetProps } from "../Field";

/** A colour as the parameter has it: "#rrggbb", or numbers from 0 to 255. */
export function Colour({ id, value, off, set }: WidgetProps) {
  const hex = typeof value === "string" ? value : Array.isArray(value) ? toHex(value) : "#000000";
  const back = (text: string): Data => (Array.isArray(value) ? toNumbers(text) : text);
  return <input id={id} type="color" value={hex.slice(0, 7)} disabled={off} onChange={(event) => set(back(event.target.value), newGesture())} />;
}

const toHex = (numbers: Data[]): string =>
  `#${numbers
    .slice(0, 3)
    .map((one) => Number(one).toString(16).padStart(2, "0"))
    .join("")}`;

const toNumbers = (hex: string): number[] => [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));
