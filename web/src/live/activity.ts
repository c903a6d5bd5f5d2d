import { socket } from "../state/link";
import { edgeKey, isInside, nodeOf } from "../state/paths";
import { change, studio } from "../state/studio";

type Move = [time: number, path: string, on: boolean, cause: string | null];

interface ActivityFrame {
  active: Record<string, number>;
  moves: Move[];
  lost?: number;
}

/** How long a pulse runs along the line before the ring appears at its end. */
export const PULSE_MS = 240;

const still = window.matchMedia("(prefers-reduced-motion: reduce)");
const pulses = new Set<(edges: string[]) => void>();

export function onPulse(act: (edges: string[]) => void): () => void {
  pulses.add(act);
  return () => pulses.delete(act);
}

export function watchActivity(): void {
  socket.subscribe("activity", {}, 30, (value) => heard(value as ActivityFrame));
}

function heard(frame: ActivityFrame): void {
  const ways = waysOf(frame.moves);
  const calm = ways.length === 0 || still.matches || document.hidden;
  const next = { since: frame.active, ways: ways.length > 0 ? new Set(ways) : studio().activity.ways };
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

/** The edges over which activity came: those whose target woke and whose source has just given it away. */
function waysOf(moves: readonly Move[]): string[] {
  const { edges } = studio().tables;
  const found: string[] = [];
  for (const [, path, on, cause] of moves) {
    if (!on) continue;
    if (cause !== null && cause in edges) {
      found.push(cause);
      continue;
    }
    const gave = moves.filter(([, , other]) => !other).map(([, one]) => one);
    for (const edge of Object.values(edges)) {
      const target = nodeOf(edge.target);
      const source = nodeOf(edge.source);
      const arrives = target === path || isInside(path, target || "\0");
      const leaves = gave.some((one) => one === source || isInside(one, source || "\0"));
      if (edge.active && arrives && leaves && source !== target) found.push(edgeKey(edge.source, edge.target));
    }
  }
  return found;
}
