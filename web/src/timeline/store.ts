import { create } from "zustand";
import { type ActivityFrame, onActivity } from "../live/activity";
import { socket } from "../state/link";

export type Box = [node: string, group: string, begin: number, end: number];
export type Span = [node: string, begin: number, end: number | null];
interface Frame {
  boxes: Box[];
  now: number;
  lost: number;
  /** What was active before the page came: in the first frame. */
  activity?: Span[];
}

/** Boxes that are kept; the oldest go. Spans of activity are few and all stay. */
const MOST_BOXES = 60_000;

export interface Record {
  boxes: Box[];
  spans: Span[];
  now: number;
  /** Counts what has arrived. */
  turn: number;
}

/** What the timeline shows lives outside of React; a frame of the screen draws it. */
export const record: Record = { boxes: [], spans: [], now: 0, turn: 0 };

interface Window {
  follows: boolean;
  length: number;
  /** Right end, where it does not follow. */
  end: number;
}

export const useWindow = create<Window>()(() => ({ follows: true, length: 14, end: 0 }));

let watching = 0;
let subscription: ReturnType<typeof socket.subscribe> | null = null;
let run = -1;

export function watchTimeline(number: number): () => void {
  if (number !== run) {
    run = number;
    Object.assign(record, { boxes: [], spans: [], now: 0, turn: record.turn + 1 });
  }
  watching++;
  subscription ??= socket.subscribe("timeline", {}, 15, (value) => heard(value as Frame));
  return () => {
    watching--;
    if (watching > 0) return;
    subscription?.end();
    subscription = null;
  };
}

function heard(frame: Frame): void {
  if (frame.activity) record.spans = joined(frame.activity, record.spans);
  for (const box of frame.boxes) record.boxes.push(box);
  if (record.boxes.length > MOST_BOXES) record.boxes = record.boxes.slice(-MOST_BOXES / 2);
  record.now = frame.now;
  record.turn++;
}

/** Both, once each: what the studio has kept, and what has begun since. */
function joined(kept: Span[], own: Span[]): Span[] {
  const begun = new Map(kept.map((span) => [`${span[0]} ${span[1].toFixed(3)}`, span]));
  for (const span of own) {
    const known = begun.get(`${span[0]} ${span[1].toFixed(3)}`);
    if (!known) begun.set(`${span[0]} ${span[1].toFixed(3)}`, span);
    else known[2] ??= span[2];
  }
  return [...begun.values()].sort((a, b) => a[1] - b[1]);
}

/** Spans of activity begin and end with its changes; what was active before the page came began when the studio says. */
function noteActivity(frame: ActivityFrame): void {
  for (const [time, path, on] of frame.moves) {
    const open = record.spans.findLast((one) => one[0] === path && one[2] === null);
    if (on && !open) record.spans.push([path, time, null]);
    else if (!on && open) open[2] = time;
  }
  for (const span of record.spans) {
    if (span[2] === null && !(span[0] in frame.active)) span[2] = Math.max(span[1], record.now);
  }
  for (const [path, since] of Object.entries(frame.active)) {
    if (!record.spans.some((one) => one[0] === path && one[2] === null)) record.spans.push([path, since, null]);
  }
  record.turn++;
}

onActivity(noteActivity);
