import { newGesture } from "../../state/actions";
import type { WidgetProps } from "../Field";

export function Switch({ id, value, off, set }: WidgetProps) {
  return <input id={id} type="checkbox" checked={value === true} disabled={off} onChange={(event) => set(event.target.checked, newGesture())} />;
}
