import { create } from "zustand";
import { type ActivityFrame, onActivity } from "../live/activity";
import { isSeeking } from "../live/replay";
import { socket } from "../state/link";
import { isRecording } from "../state/looking";
import { studio } from "../state/studio";

export type Box = [node: string, group: string, begin: number, end: number];
export type Span = [node: string, begin: number, end: number | null];
interface Frame {
  boxes: Box[];
  now: number;
  lost: number;
  /** Of a recording: how long it is, whether these boxes replace the others, and which spans it knows. */
  length?: number;
  fresh?: boolean;
  turn?: number;
  /** What was active before the page came: in the first frame. */
  activity?: Span[];
}

/** Boxes that are kept; the oldest go. Spans of activity are few and all stay. */
const MOST_BOXES = 60_000;
/** Of a recording, at first. */
const FIRST_S = 60;

export interface Record {
  boxes: Box[];
  spans: Span[];
  /** The end of what there is. */
  now: number;
  /** The time that a recording shows; a run shows its end. */
  cursor: number | null;
  /** Firings of the window that are not drawn, because there are too many. */
  lost: number;
  /** Counts what has arrived. */
  turn: number;
}

/** What the timeline shows lives outside of React; a frame of the screen draws it. */
export const record: Record = { boxes: [], spans: [], now: 0, cursor: null, lost: 0, turn: 0 };

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
    Object.assign(record, { boxes: [], spans: [], now: 0, cursor: null, lost: 0, turn: record.turn + 1 });
  }
  watching++;
  const args = isRecording(studio().tables.studio.run) ? windowed() : {};
  subscription ??= socket.subscribe("timeline", args, 30, (value) => heard(value as Frame));
  return () => {
    watching--;
    if (watching > 0) return;
    subscription?.end();
    subscription = null;
  };
}

/** The firings of a recording come for the window, and as much on both sides. */
const windowed = () => {
  const { end, length } = useWindow.getState();
  return { begin: end - 2 * length, end: end + length, turn: spansKnown };
};

let spansKnown = -1;
let later = 0;

useWindow.subscribe(() => {
  if (record.cursor === null || subscription === null) return;
  clearTimeout(later);
  later = window.setTimeout(() => subscription?.change(windowed()), 60);
});

function heardOfRecording(frame: Frame, length: number): void {
  const isFirst = record.cursor === null;
  record.now = length;
  if (isFirst || !isSeeking()) record.cursor = frame.now;
  if (frame.activity) [record.spans, spansKnown] = [frame.activity, frame.turn ?? -1];
  if (frame.fresh) [record.boxes, record.lost] = [frame.boxes, frame.lost];
  record.turn++;
  if (isFirst) useWindow.setState({ length: Math.min(Math.max(length, 0.3), FIRST_S), end: Math.max(Math.min(length, FIRST_S), 0.3) });
  keepInView();
}

/** The window turns over like a page when the cursor leaves it. */
function keepInView(): void {
  const { follows, length, end } = useWindow.getState();
  const at = record.cursor ?? 0;
  if (!follows || (at >= end - length && at <= end)) return;
  const turned = at > end ? at + 0.9 * length : at + 0.1 * length;
  useWindow.setState({ end: Math.min(Math.max(turned, length), Math.max(record.now, length)) });
}

function heard(frame: Frame): void {
  if (frame.length !== undefined) {
    heardOfRecording(frame, frame.length);
    return;
  }
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
  if (isRecording(studio().tables.studio.run)) return; // it knows all spans
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
