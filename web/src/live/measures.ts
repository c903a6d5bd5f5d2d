import { type Measure, readMeasures } from "../protocol/frames";
import { socket } from "../state/link";
import { givesWay } from "../ui/giving";

/** Measured figures live outside of React: thirty times a second they go straight to the painters of visible nodes. */
type Painter = (measure: Measure, slow: boolean) => void;

const painters = new Map<string, Set<Painter>>();
const latest = new Map<string, Measure>();
let order: string[] = [];
let subscription: ReturnType<typeof socket.subscribe> | null = null;
let scheduled = 0;
let lastSlow = 0;
let lastPainted = 0;

/** Texts change at most four times a second, bars as often as they come. */
const SLOW_MS = 250;

export function paintMeasures(path: string, paint: Painter): () => void {
  const known = painters.get(path) ?? new Set<Painter>();
  known.add(paint);
  painters.set(path, known);
  const measure = latest.get(path);
  if (measure) paint(measure, true);
  reschedule();
  return () => {
    known.delete(paint);
    if (known.size === 0) painters.delete(path);
    reschedule();
  };
}

export const measureOf = (path: string): Measure | undefined => latest.get(path);

function reschedule(): void {
  clearTimeout(scheduled);
  scheduled = window.setTimeout(subscribe, subscription === null ? 0 : 200);
}

function subscribe(): void {
  const wanted = [...painters.keys()].sort();
  if (wanted.length === order.length && wanted.every((path, index) => path === order[index])) return;
  order = wanted;
  if (subscription === null) {
    subscription = socket.subscribe("measures", { nodes: order }, 30, (_, __, frame) => {
      if (frame) heard(readMeasures(frame.body));
    });
  } else subscription.change({ nodes: order });
}

function heard(measures: Measure[]): void {
  if (measures.length !== order.length) return; // it answers what was wanted before
  const now = performance.now();
  if (givesWay(lastPainted)) return; // the next frame has newer ones
  lastPainted = now;
  const slow = now - lastSlow >= SLOW_MS;
  if (slow) lastSlow = now;
  measures.forEach((measure, index) => {
    const path = order[index];
    if (path === undefined) return;
    latest.set(path, measure);
    for (const paint of painters.get(path) ?? []) paint(measure, slow);
  });
}
