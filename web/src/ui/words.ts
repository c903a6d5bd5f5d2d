/** Numbers in words, at widths that stay: tabular digits, fixed decimals within a range. */

export function duration(seconds: number | null | undefined): string {
  if (seconds == null || !Number.isFinite(seconds) || seconds < 0) return "–";
  const ms = seconds * 1000;
  if (ms >= 10_000) return `${seconds.toFixed(1)} s`;
  if (ms >= 1000) return `${seconds.toFixed(2)} s`;
  if (ms >= 10) return `${ms.toFixed(1)} ms`;
  if (ms >= 0.0995) return `${ms.toFixed(2)} ms`;
  return `${Math.round(ms * 1000)} µs`;
}

export function rate(hz: number | null | undefined): string {
  if (hz == null || !(hz > 0.05)) return "idle";
  return hz >= 100 ? `${Math.round(hz)} Hz` : `${hz.toFixed(1)} Hz`;
}

export const clock = (seconds: number): string => `${seconds.toFixed(2)} s`;
export const moment = (seconds: number): string => `${seconds.toFixed(1)} s`;
export const percent = (share: number): string => `${(share * 100).toFixed(1)} %`;
export const counted = (n: number): string => n.toLocaleString("en");

export function plural(n: number, one: string, many = `${one}s`): string {
  return `${counted(n)} ${n === 1 ? one : many}`;
}

/** A value as a text that can stand in a line. */
export function short(value: unknown): string {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : String(+value.toPrecision(6));
  if (typeof value === "string") return value;
  return JSON.stringify(value) ?? "";
}

/** A value of a parameter, for people. */
export const said = (value: unknown): string => (value === null || value === undefined ? "none" : value === true ? "yes" : value === false ? "no" : short(value));
