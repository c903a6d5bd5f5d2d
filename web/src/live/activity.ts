import { socket } from "../state/link";
import { change, studio } from "../state/studio";

type Move = [time: number, path: string, on: boolean, cause: string | null, via?: string[]];

export interface ActivityFrame {
  active: Record<string, number>;
  moves: Move[];
  lost?: number;
  /** The cursor of a recording has jumped: nothing moves along the lines. */
  still?: boolean;
}

/** How long a pulse runs along the line before the ring appears at its end. */
export const PULSE_MS = 240;

const still = window.matchMedia("(prefers-reduced-motion: reduce)");
const listeners = new Set<(frame: ActivityFrame) => void>();
const pulses = new Set<(edges: string[]) => void>();

export function onPulse(act: (edges: string[]) => void): () => void {
  pulses.add(act);
  return () => pulses.delete(act);
}

/** Every change of activity, in order. */
export function onActivity(act: (frame: ActivityFrame) => void): void {
  listeners.add(act);
}

export function watchActivity(): void {
  socket.subscribe("activity", {}, 30, (value) => heard(value as ActivityFrame));
}

function heard(frame: ActivityFrame): void {
  for (const act of listeners) act(frame);
  const ways = waysOf(frame.moves);
  const calm = ways.length === 0 || frame.still === true || still.matches || document.hidden;
  const next = { since: frame.active, ways: ways.length > 0 ? lastWays(frame.moves) : studio().activity.ways };
  if (calm) {
    show(next);
    return;
  }
  change({ activity: { since: studio().activity.since, ways: next.ways } });
  for (const pulse of pulses) pulse(ways);
  setTimeout(() => show(next), PULSE_MS);
}

function show(next: { since: Record<string, number>; ways: ReadonlySet<string> }): void {
  const before = studio().activity.since;
  const same = sameKeys(before, next.since) && next.ways === studio().activity.ways;
  if (!same) change({ activity: next, announced: sentence(before, next.since) || studio().announced });
}

function sameKeys(one: Record<string, number>, other: Record<string, number>): boolean {
  const keys = Object.keys(one);
  return keys.length === Object.keys(other).length && keys.every((key) => one[key] === other[key]);
}

/** For the live region of screen readers, at most once a second there. */
function sentence(before: Readonly<Record<string, number>>, now: Record<string, number>): string {
  const come = Object.keys(now).filter((path) => !(path in before));
  return come.length > 0 ? `${come.join(", ")} active` : "";
}

/** The edges over which activity came, as the studio says. */
const waysOf = (moves: readonly Move[]): string[] => moves.flatMap(([, , on, , via]) => (on ? (via ?? []) : []));

/** The last way of each level; older ones are orange no more. */
const last = new Map<string, string[]>();

function lastWays(moves: readonly Move[]): Set<string> {
  const { edges } = studio().tables;
  for (const [, , on, , via] of moves) {
    if (!on || !via) continue;
    for (const [level, ways] of Map.groupBy(via, (key) => edges[key]?.level ?? "")) last.set(level, ways);
  }
  return new Set([...last.values()].flat());
}
