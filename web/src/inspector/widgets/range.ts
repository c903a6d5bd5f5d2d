import type { ParameterType } from "../../protocol/types";

/** More than so many times the usual value is out of reach of a slider; one can type it. */
const FARTHEST = 20;
const OF_ZERO: Record<string, number> = { int: 40, float: 1 };

/** The ends of the slider: the limits where there are any, else a range around the default that one can drag in. */
export function rangeOf(type: Pick<ParameterType, "low" | "high" | "limits" | "default" | "kind">, value: number): [number, number] {
  const usual = Math.abs(typeof type.default === "number" && type.default !== 0 ? type.default : value);
  const base = usual || (OF_ZERO[type.kind] ?? 1);
  const low = type.low ?? type.limits?.ge ?? type.limits?.gt ?? (value < 0 ? -2.5 * base : 0);
  const high = type.high ?? type.limits?.le ?? type.limits?.lt;
  const near = Math.max(low + 2.5 * base, value);
  return [low, high === undefined || high === null || (usual > 0 && high > FARTHEST * usual) ? near : high];
}

export function niceStep(range: number): number {
  return 10 ** Math.floor(Math.log10(Math.max(range, 1e-9) / 50));
}

export function tidy(value: number, step: number, whole: boolean): number {
  if (whole) return Math.round(value);
  return +(Math.round(value / step) * step).toPrecision(10);
}

export function digits(value: number, step: number, whole: boolean): string {
  if (whole) return String(value);
  const places = Math.min(6, Math.max(1, -Math.floor(Math.log10(step))));
  const text = value.toFixed(places);
  return Number(text) === value ? text : String(+value.toPrecision(6));
}
