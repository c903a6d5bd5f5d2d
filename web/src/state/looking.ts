import type { NodeRecord, RunRecord, Tables, Value } from "../protocol/types";
import { isInside } from "./paths";
import type { Activity, Studio } from "./studio";

/** The innermost active node in a subgraph, of several the one that became active last. */
export function activeInside(activity: Activity, path: string): string | null {
  let best: string | null = null;
  for (const [one, since] of Object.entries(activity.since)) {
    if (!isInside(one, path)) continue;
    if (best === null || one.startsWith(`${best}/`) || (since > (activity.since[best] ?? 0) && !best.startsWith(`${one}/`))) {
      best = one;
    }
  }
  return best;
}

/** After how long a node hands its activity on by itself, in seconds. */
export function limitOf(node: NodeRecord | undefined): number | null {
  const limit = node?.options.active_for_s;
  return typeof limit === "number" ? limit : null;
}

/** Nothing is open, and nobody has begun anything. */
export const isStart = (state: Studio): boolean =>
  state.rev >= 0 && !state.begun && state.tables.studio.file?.kind === "none" && Object.keys(state.tables.nodes).length === 0;

export const isRecording = (run: RunRecord | undefined): boolean => typeof run?.length_s === "number";

export function elapsed(run: RunRecord | undefined, clockOffset: number): number {
  if (!run) return 0;
  const moving = run.state === "running" || run.state === "stepping";
  const now = run.elapsed_s + (moving && run.clock === "real" ? Math.max(0, Date.now() / 1000 + clockOffset - run.at) : 0);
  return Math.min(now, run.length_s ?? Number.POSITIVE_INFINITY);
}

/** The number of a group gives its colour; from the fifth on the four colours come again with another stripe. */
export function groupClass(tables: Tables, group: string): string {
  const number = tables.groups[group]?.number ?? 0;
  if (number === 0) return "";
  const colour = `g${((number - 1) % 4) + 1}`;
  return number > 4 ? `${colour} again${Math.floor((number - 1) / 4)}` : colour;
}

/** A value with the time at which it was seen: a recording says when it was sent. Before the first one there is none. */
export const valueSeen = (next: unknown, time: number): Value | null =>
  next === null ? null : { ...(next as Value), time: (next as Partial<Value>).time ?? time };
