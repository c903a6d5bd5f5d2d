import { Socket } from "../protocol/socket";
import type { FromStudio } from "../protocol/types";
import { applied, fromSnapshot } from "./replica";
import { change, layoutKey, studio } from "./studio";

/** The page's end of the socket: what arrives goes into the state. */
export const socket = new Socket(address(), {
  hello(hello) {
    change({ hello, clockOffset: hello.now - Date.now() / 1000 });
  },
  message: heard,
  heard() {
    if (studio().age > 0 && studio().phase === "open") change({ age: 0, ageSeconds: 0 });
  },
  opened() {
    change({ phase: "open", age: 0, ageSeconds: 0, wire: null });
    opened = [];
    showLevel();
  },
  closed(code, reason) {
    if (code === OTHER_THING) {
      location.reload(); // nothing that the page has is of that
      return;
    }
    const state = studio();
    const closedAt = state.phase === "closed" ? state.closedAt : performance.now();
    change({ phase: code === 4401 || code === 1008 ? "refused" : "closed", closedWhy: reason, closedAt, wire: null });
  },
  known() {
    const { hello, rev } = studio();
    return rev < 0 || hello === null ? null : { boot: boot ?? "", rev };
  },
});

/** The studio closes with this code when it shows a recording instead of a graph, or the other way round. */
const OTHER_THING = 4012;

let boot: string | null = null;
/** Levels that the studio lays out for this page, the one that is shown last: who comes back finds them as they are. */
let opened: { path: string; view: string; deep: boolean }[] = [];
const KEPT_LEVELS = 8;

function address(): string {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  return `${scheme}://${location.host}/ws`;
}

function heard(message: FromStudio): void {
  if (message.t === "snapshot") {
    boot = studio().hello?.boot ?? null;
    const first = studio().rev < 0;
    change({ rev: message.rev, tables: fromSnapshot(message.tables) });
    if (first) change({ level: studio().hello?.level ?? "" });
    keepLevel();
    showLevel();
  } else if (message.t === "patch") {
    const state = studio();
    if (message.rev <= state.rev) return;
    change({ rev: message.rev, tables: applied(state.tables, message.ops) });
    keepLevel();
  }
}

/** A level or a node that somebody has removed cannot stay on the screen. */
function keepLevel(): void {
  const { level, tables, selection } = studio();
  if (level !== "" && !tables.nodes[level]?.subgraph) change({ level: level.slice(0, Math.max(0, level.lastIndexOf("/"))) });
  const left = [...selection].filter((path) => path in tables.nodes);
  if (left.length < selection.size) change({ selection: new Set(left) });
}

/** Tells the studio which level and view it is to lay out. */
export function showLevel(): void {
  const state = studio();
  const wanted = { path: state.level, view: state.views[state.level] ?? "", deep: state.deep[state.level] ?? false };
  const same = (one: typeof wanted) => one.path === wanted.path && one.view === wanted.view && one.deep === wanted.deep;
  if (opened.length > 0 && same(opened.at(-1)!)) return;
  if (!opened.some(same) && !socket.send({ t: "level", ...wanted, open: true })) return;
  opened = [...opened.filter((one) => !same(one)), wanted];
  for (const one of opened.splice(0, opened.length - KEPT_LEVELS)) socket.send({ t: "level", ...one, open: false });
}

const LOOK_MS = 250;

/** Old data looks old: after one second without a word the dot is grey, after three the picture is. */
export function watchAge(): void {
  let looked = performance.now();
  setInterval(() => {
    const late = performance.now() - looked > 4 * LOOK_MS;
    looked = performance.now();
    if (late) return; // this page has stood still, not the studio: its words are read first
    const state = studio();
    const running = ["running", "starting"].includes(state.tables.studio.run?.state ?? "");
    const since = state.phase === "closed" ? state.closedAt : socket.lastWord;
    const quiet = state.phase === "closed" || (state.phase === "open" && running);
    const seconds = quiet ? (performance.now() - since) / 1000 : 0;
    const age = seconds >= 3 ? 3 : seconds >= 1 ? 1 : 0;
    const ageSeconds = Math.floor(seconds);
    if (age !== state.age || (age > 0 && ageSeconds !== state.ageSeconds)) change({ age, ageSeconds });
  }, LOOK_MS);
}

export { layoutKey };
