import { socket } from "../state/link";

/** The last values of ports, for whatever paints them: one subscription for all that are on the screen. */
type Painter = (text: string | null) => void;

const painters = new Map<string, Set<Painter>>();
const latest = new Map<string, string | null>();
let subscription: ReturnType<typeof socket.subscribe> | null = null;
let scheduled = 0;
let asked = "";

export function paintValue(path: string, paint: Painter): () => void {
  const known = painters.get(path) ?? new Set<Painter>();
  known.add(paint);
  painters.set(path, known);
  const text = latest.get(path);
  if (text !== undefined) paint(text);
  reschedule();
  return () => {
    known.delete(paint);
    if (known.size === 0) {
      painters.delete(path);
      latest.delete(path);
    }
    reschedule();
  };
}

function reschedule(): void {
  clearTimeout(scheduled);
  scheduled = window.setTimeout(subscribe, 100);
}

function subscribe(): void {
  const paths = [...painters.keys()].sort();
  if (paths.join() === asked) return;
  asked = paths.join();
  if (paths.length === 0) {
    subscription?.end();
    subscription = null;
  } else if (subscription === null) subscription = socket.subscribe("values", { paths }, 4, (value) => heard(value as Record<string, string | null>));
  else subscription.change({ paths });
}

function heard(values: Record<string, string | null>): void {
  for (const [path, text] of Object.entries(values)) {
    if (!painters.has(path)) continue;
    latest.set(path, text);
    for (const paint of painters.get(path)!) paint(text);
  }
}
