import type { Span } from "./store";

export interface Piece {
  path: string;
  name: string;
  begin: number;
  end: number;
  now: boolean;
}

/** Spans closer than this are one: handing activity over takes no time that one could see. */
const GAP_S = 0.05;

/** Three rows: the step of the mission, what is inside of it, and the innermost, with the rest of its path.
 * What is active at a time is now, else what has no end. */
export function icicle(spans: readonly Span[], from: number, now: number, rows = 3, at: number | null = null): Piece[][] {
  const found: Piece[][] = Array.from({ length: rows }, () => []);
  const sorted = [...spans].filter(([, , end]) => end === null || end >= from).sort((a, b) => a[1] - b[1]);
  for (const [path, begin, end] of sorted) {
    const parts = path.split("/");
    parts.slice(0, rows).forEach((part, row) => {
      const last = row === rows - 1;
      if (last && parts.length > rows && row !== rows - 1) return;
      const key = last ? path : parts.slice(0, row + 1).join("/");
      const name = last && parts.length > rows ? parts.slice(rows - 1).join(" › ") : part;
      const piece = { path: key, name, begin, end: end ?? now, now: at === null ? end === null : begin <= at && at < (end ?? Number.POSITIVE_INFINITY) };
      const before = found[row]!.at(-1);
      if (before && before.path === key && begin - before.end < GAP_S) {
        before.end = Math.max(before.end, piece.end);
        before.now ||= piece.now;
      } else found[row]!.push(piece);
    });
  }
  return found;
}

/** The steps of the mission alone: the first names of the paths, one after the other. */
export function steps(spans: readonly Span[], now: number, at: number | null = null): Piece[] {
  const short = spans.map(([path, begin, end]): Span => [path.split("/")[0]!, begin, end]);
  return icicle(short, 0, now, 1, at)[0]!;
}

/** Leaves out levels that all spans share, such as the only robot. */
export function withoutCommon(spans: readonly Span[]): { spans: Span[]; prefix: string } {
  let prefix = spans[0]?.[0].split("/").slice(0, -1) ?? [];
  for (const [path] of spans) {
    const parts = path.split("/").slice(0, -1);
    let same = 0;
    while (same < prefix.length && prefix[same] === parts[same]) same++;
    prefix = prefix.slice(0, same);
  }
  const length = prefix.length === 0 ? 0 : prefix.join("/").length + 1;
  return { spans: spans.map(([path, begin, end]) => [path.slice(length), begin, end]), prefix: prefix.join("/") };
}

export interface Lane {
  /** Where all of it is; the paths are given without it. */
  prefix: string;
  spans: Span[];
}

/** More than these would leave no room for the groups; what is left over shares the last one. */
const MOST_LANES = 4;

/** What was active at the same time goes into lanes of its own, such as each of two robots; what follows each other into one. */
export function lanesOf(spans: readonly Span[], now: number): Lane[] {
  const { spans: short, prefix } = withoutCommon(spans);
  const tops = new Map<string, Span[]>();
  for (const span of short) {
    const top = span[0].split("/")[0]!;
    const own = tops.get(top);
    if (own) own.push(span);
    else tops.set(top, [span]);
  }
  const together = concurrent(short, now);
  const lanes: string[][] = [];
  for (const top of tops.keys()) {
    const free = lanes.find((lane) => lane.every((one) => !together.has(`${one}/${top}`)));
    if (free) free.push(top);
    else if (lanes.length < MOST_LANES) lanes.push([top]);
    else lanes.at(-1)!.push(top);
  }
  if (lanes.length === 1) return [{ prefix, spans: short }];
  return lanes.map((lane) => {
    const inside = lane.flatMap((top) => tops.get(top)!);
    const top = lane[0]!;
    if (lane.length > 1 || inside.some(([path]) => path === top)) return { prefix, spans: inside };
    const own = inside.map(([path, begin, end]): Span => [path.slice(top.length + 1), begin, end]);
    return { prefix: prefix === "" ? top : `${prefix}/${top}`, spans: own };
  });
}

/** Pairs of first names that were active at the same time for longer than handing over takes, as "a/b" and "b/a". */
function concurrent(spans: readonly Span[], now: number): Set<string> {
  const found = new Set<string>();
  const ends = new Map<string, number>();
  for (const [path, begin, end] of [...spans].sort((a, b) => a[1] - b[1])) {
    const top = path.split("/")[0]!;
    for (const [other, until] of ends) {
      if (other !== top && Math.min(until, end ?? now) - begin > GAP_S) found.add(`${top}/${other}`).add(`${other}/${top}`);
    }
    ends.set(top, Math.max(ends.get(top) ?? 0, end ?? now));
  }
  return found;
}

export function tickStep(length: number): number {
  if (length > 20_000) return 3600;
  if (length > 3000) return 600;
  if (length > 300) return 60;
  if (length > 60) return 10;
  if (length > 20) return 5;
  if (length > 8) return 1;
  if (length > 2) return 0.5;
  if (length > 0.5) return 0.1;
  return 0.02;
}
