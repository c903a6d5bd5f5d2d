import type { PointerEvent } from "react";

interface Props {
  way: "v" | "h";
  variable: "--side" | "--time" | "--stage";
  usual: number;
  least: number;
  most: number;
  label: string;
  /** The panel lies before the divider, and so grows with it. */
  before?: boolean;
}

/** Drags a panel wider or higher; a double click gives the usual size. */
export function Divider({ way, variable, usual, least, most, label, before = false }: Props) {
  const root = document.documentElement.style;
  const set = (size: number) => root.setProperty(variable, `${Math.min(most, Math.max(least, size))}px`);
  const down = (event: PointerEvent<HTMLDivElement>) => {
    const element = event.currentTarget;
    const box = element.parentElement!.getBoundingClientRect();
    const from = way === "v" ? event.clientX : event.clientY;
    const was = way === "v" ? box.width : Number.parseFloat(getComputedStyle(document.documentElement).getPropertyValue(variable)) || usual;
    element.setPointerCapture(event.pointerId);
    element.onpointermove = (move) => set(was + (before ? -1 : 1) * (from - (way === "v" ? move.clientX : move.clientY)));
    element.onpointerup = () => {
      element.onpointermove = null;
    };
  };
  return (
    <div
      className={`divider ${way}${before ? " before" : ""}`}
      role="separator"
      aria-label={label}
      aria-orientation={way === "v" ? "vertical" : "horizontal"}
      onPointerDown={down}
      onDoubleClick={() => set(usual)}
    />
  );
}
