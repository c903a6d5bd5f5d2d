import { create } from "zustand";
import { socket } from "../state/link";

export type Box = [node: string, group: string, begin: number, end: number];
export type Span = [node: string, begin: number, end: number | null];
type Open = [node: string, group: string, begin: number];

interface Frame {
  boxes: Box[];
  activity: Span[];
  now: number;
  lost: number;
  open?: Open[];
  fresh?: boolean;
}

/** Boxes that are kept; the oldest go. Spans of activity are few and all stay. */
const MOST_BOXES = 60_000;

export interface Record {
  boxes: Box[];
  spans: Span[];
  open: Open[];
  now: number;
  loads: Map<string, number>;
  /** Counts what has arrived. */
  turn: number;
}

/** What the timeline shows lives outside of React; a frame of the screen draws it. */
export const record: Record = { boxes: [], spans: [], open: [], now: 0, loads: new Map(), turn: 0 };

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
    Object.assign(record, { boxes: [], spans: [], open: [], now: 0, loads: new Map(), turn: record.turn + 1 });
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
  if (frame.fresh || frame.now < record.now - 1) {
    record.boxes = [];
    record.spans = [];
  }
  for (const box of frame.boxes) record.boxes.push(box);
  if (record.boxes.length > MOST_BOXES) record.boxes = record.boxes.slice(-MOST_BOXES / 2);
  for (const span of frame.activity) addSpan(span);
  record.open = frame.open ?? [];
  record.now = frame.now;
  record.turn++;
  measureLoads();
}

/** A span that was open comes again when it has ended. */
function addSpan(span: Span): void {
  const at = record.spans.findLastIndex((one) => one[0] === span[0] && one[1] === span[1]);
  if (at >= 0) record.spans[at] = span;
  else record.spans.push(span);
}

const LOAD_S = 5;

function measureLoads(): void {
  const from = record.now - LOAD_S;
  const busy = new Map<string, number>();
  for (let index = record.boxes.length - 1; index >= 0; index--) {
    const [, group, begin, end] = record.boxes[index]!;
    if (end < from) break;
    busy.set(group, (busy.get(group) ?? 0) + end - Math.max(from, begin));
  }
  record.loads = new Map([...busy].map(([group, spent]) => [group, spent / LOAD_S]));
}
