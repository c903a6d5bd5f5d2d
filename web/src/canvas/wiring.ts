import type { LayoutRecord, PortKind } from "../protocol/types";
import { connect, disconnect, isSource, locked, reconnect, toast } from "../state/actions";
import { edgeKey, endsOf, nodeOf } from "../state/paths";
import { change, studio, type WireDrag } from "../state/studio";
import { askTargets, type Judged } from "../state/targets";

export interface Spot {
  path: string;
  kind: PortKind;
  x: number;
  y: number;
}

const SNAP_PX = 24;

/** All ports of a level with their places, by path. */
export function spotsOf(layout: LayoutRecord): Map<string, Spot> {
  const spots = new Map<string, Spot>();
  for (const box of layout.nodes) {
    for (const port of box.ports) {
      const path = `${box.id}.${port.name}`;
      spots.set(path, { path, kind: port.kind, x: port.x, y: port.y });
    }
  }
  return spots;
}

export function nearest(spots: Map<string, Spot>, x: number, y: number, zoom: number, from: string): string | null {
  let best: string | null = null;
  let least = SNAP_PX / zoom;
  for (const spot of spots.values()) {
    const distance = Math.hypot(spot.x - x, spot.y - y);
    if (distance < least && spot.path !== from) {
      least = distance;
      best = spot.path;
    }
  }
  return best;
}

/** Which edge a drag moves: one that leads to an input which can have no second one. */
function movedEdge(port: string, kind: string): string {
  if (kind !== "input" && kind !== "parameter") return "";
  const found = Object.keys(studio().tables.edges).find((key) => endsOf(key)[1] === port);
  return found ?? "";
}

interface Known {
  from: string;
  moving: string;
  edges: unknown;
  until: number;
  targets: Promise<Judged>;
  /** Once they are here. */
  answer: Judged | null;
}

/** What an edge from the port under the mouse may lead to. */
let known: Known | null = null;
const KNOWN_MS = 3000;

function targetsOf(from: string, moving: string): Known {
  const { edges } = studio().tables;
  const now = performance.now();
  if (known?.from === from && known.moving === moving && known.edges === edges && now < known.until) return known;
  const one: Known = { from, moving, edges, until: now + KNOWN_MS, targets: askTargets(from, moving), answer: null };
  known = one;
  one.targets.then(
    (answer) => (one.answer = answer),
    () => (known = null),
  );
  return one;
}

const REST_MS = 60;
let resting = 0;

/** The mouse rests on a port: who presses next sees the targets at once. */
export function restOn(port: string, kind: string): void {
  clearTimeout(resting);
  if (port === "" || locked() !== "" || studio().wire) return;
  resting = window.setTimeout(() => void targetsOf(...beginOf(port, kind)), REST_MS);
}

/** Where a wire from a port begins, and which edge it moves. */
function beginOf(port: string, kind: string): [from: string, moving: string] {
  const moving = movedEdge(port, kind);
  return [moving === "" ? port : endsOf(moving)[0], moving];
}

/** Press on a port: what an edge may lead to comes from the studio, once, with the reasons for all refusals. */
export async function beginWire(port: string, kind: string, at: { x: number; y: number }, screen: { x: number; y: number }) {
  const why = locked();
  if (why !== "") {
    toast(why, { kind: "warn" });
    return;
  }
  const [from, moving] = beginOf(port, kind);
  const found = targetsOf(from, moving);
  change({ wire: { from, moving, targets: found.answer, over: null, point: at, screen, active: false } });
  if (found.answer) {
    light(found.answer, from);
    return;
  }
  try {
    const targets = await found.targets;
    const wire = studio().wire;
    if (wire?.from !== from) return;
    change({ wire: { ...wire, targets } });
    light(targets, from);
  } catch (error) {
    change({ wire: null });
    toast(error instanceof Error ? error.message : String(error), { kind: "bad" });
  }
}

/** Marks go straight to the elements: hundreds of ports light up within a frame. */
function light(targets: Judged, from: string): void {
  const takes = new Set<string>([nodeOf(from)]);
  for (const element of document.querySelectorAll<HTMLElement>("#canvas [data-port]")) {
    const path = element.dataset.port ?? "";
    const fit = targets.ports.get(path)?.fit;
    element.classList.toggle("from", path === from);
    element.classList.toggle("expects", fit === "expects");
    element.classList.toggle("any", fit === "takes");
    if (fit === "expects" || fit === "takes") takes.add(nodeOf(path));
  }
  for (const element of document.querySelectorAll<HTMLElement>("#canvas [data-node]")) {
    element.classList.toggle("takes", takes.has(element.dataset.node ?? ""));
  }
}

function unlight(): void {
  for (const element of document.querySelectorAll("#canvas :is(.from, .expects, .any, .takes)")) {
    element.classList.remove("from", "expects", "any", "takes");
  }
}

export function endWire(): void {
  change({ wire: null });
  unlight();
}

/** What a wire may lead to; who drops it at once may be faster than the studio. */
const answerFor = (wire: WireDrag): Promise<Judged | null> =>
  wire.targets ? Promise.resolve(wire.targets) : targetsOf(wire.from, wire.moving).targets.catch(() => null);

/** Drop: connect, move, cut, or choose what lies between. */
export async function dropWire(place: { x: number; y: number }): Promise<void> {
  const wire = studio().wire;
  endWire();
  if (!wire) return;
  if (wire.over === null) {
    if (wire.moving !== "") await disconnect(wire.moving);
    else openPalette(wire.from, wire.screen, place);
    return;
  }
  const fit = (await answerFor(wire))?.ports.get(wire.over);
  if (fit === undefined) return;
  if (fit.fit === "refused") {
    openPalette(wire.from, wire.screen, place);
    return;
  }
  const [source, target] = isSource(wire.from) ? [wire.from, wire.over] : [wire.over, wire.from];
  const key = edgeKey(source, target);
  change({ asked: [...studio().asked, key] });
  const done = await (wire.moving !== "" ? reconnect(wire.moving, source, target) : connect(source, target, wire.active));
  if (!done) forgetAsked([key]);
}

/** The studio has drawn these edges, or refused them. */
export function forgetAsked(keys: readonly string[]): void {
  change({ asked: studio().asked.filter((one) => !keys.includes(one)) });
}

export function openPalette(port: string, screen: { x: number; y: number }, place: { x: number; y: number }, words = ""): void {
  const why = locked();
  if (why !== "") toast(why, { kind: "warn" });
  else change({ popover: "palette", palette: { screen, place, port, words } });
}
