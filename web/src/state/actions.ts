import { Refusal } from "../protocol/socket";
import type { ActionRecord, Command, Data, FoundRow, Message } from "../protocol/types";
import { socket, showLevel } from "./link";
import { edgeKey, endsOf, isInside, joined, nameOf, parentOf } from "./paths";
import { isRecording } from "./looking";
import { change, studio, type Toast, type View } from "./studio";

let toasts = 0;
let gestures = 0;

export const newGesture = (): string => `${studio().hello?.viewer ?? 0}-${++gestures}`;

/** Says something; gives the number by which it can be taken away. */
export function toast(text: string, more: Partial<Omit<Toast, "id" | "text">> = {}, lasts = 6000): number {
  const one: Toast = { id: ++toasts, kind: "plain", title: "", ...more, text };
  const others = studio().toasts.filter((other) => other.text !== text).slice(-2);
  change({ toasts: [...others, one] });
  if (lasts > 0) endings.set(one.id, window.setTimeout(() => dropToast(one.id), lasts));
  return one.id;
}

const endings = new Map<number, number>();
const AFTERWARDS_MS = 2000;

/** A sentence stays while the mouse or the focus is on it: nobody loses the button that is about to be pressed. */
export function holdToast(id: number, held: boolean): void {
  if (!endings.has(id)) return;
  clearTimeout(endings.get(id));
  if (!held) endings.set(id, window.setTimeout(() => dropToast(id), AFTERWARDS_MS));
}

export function dropToast(id: number): void {
  endings.delete(id);
  change({ toasts: studio().toasts.filter((one) => one.id !== id) });
}

/** Sends a request; a refusal is said in the studio's own words. */
export async function ask<T = unknown>(message: Message): Promise<T | null> {
  try {
    return (await socket.request(message)) as T;
  } catch (error) {
    const words = error instanceof Error ? error.message : String(error);
    toast(words, { kind: error instanceof Refusal ? "bad" : "warn" });
    return null;
  }
}

export const question = <T>(what: string, args: Record<string, unknown>): Promise<T> =>
  socket.request({ t: "ask", what, args }) as Promise<T>;

export const tell = (t: string, fields: Record<string, unknown> = {}): Promise<unknown> => ask({ t, ...fields });

export async function edit(commands: Command[], gesture = ""): Promise<boolean> {
  if (commands.length === 0) return true;
  return (await ask({ t: "edit", commands, gesture })) !== null;
}

export async function undo(): Promise<void> {
  const last = studio().tables.studio.history?.done.at(-1);
  if ((await tell("undo")) !== null && last) toast(`Undone: ${last.text}`, {}, 2000);
}

export async function redo(): Promise<void> {
  const last = studio().tables.studio.history?.undone.at(-1);
  if ((await tell("redo")) !== null && last) toast(`Done again: ${last.text}`, {}, 2000);
}

/** Opens a file; of code with several graphs one is chosen then. */
export async function openFile(path: string, discard = false): Promise<void> {
  try {
    await socket.request({ t: "open", path, discard });
    change({ popover: null });
  } catch (error) {
    const names = error instanceof Refusal ? error.reject.choices : [];
    if (names.length > 0) change({ popover: "open", several: { path, names } });
    else toast(error instanceof Error ? error.message : String(error), { kind: error instanceof Refusal ? "bad" : "warn" });
  }
}

// --- where the person looks ---

export function enter(path: string): void {
  if (path === studio().level) return;
  change({ level: path, selectedEdge: null, menu: null });
  showLevel();
}

export function leave(): void {
  const { level } = studio();
  if (level === "") return;
  enter(parentOf(level));
  select([level]);
}

export function choose(view: View): void {
  const { level, views } = studio();
  change({ views: { ...views, [level]: view } });
  showLevel();
}

/** Shows what is inside of all subgraphs of the level, or closes them. */
export function openAll(): void {
  const { level, deep } = studio();
  change({ deep: { ...deep, [level]: !deep[level] } });
  showLevel();
}

export function select(paths: Iterable<string>): void {
  change({ selection: new Set(paths), selectedEdge: null, annotation: null });
}

/** Goes to where a node is, and selects it. */
export function show(path: string): void {
  if (!(path in studio().tables.nodes)) return;
  enter(parentOf(path));
  select([path]);
  window.dispatchEvent(new CustomEvent("hfg-show", { detail: path }));
}

export const chosen = (): string[] => [...studio().selection];

/** Whether nothing may be changed now, and why. */
export function locked(): string {
  const { hello } = studio();
  return hello?.read_only || waits();
}

/** Whether the run cannot be steered now, and why; a recording can be played by everyone who looks at it. */
export const unsteerable = (): string => (isRecording(studio().tables.studio.run) ? waits() : locked());

function waits(): string {
  const { age, phase } = studio();
  if (age === 3 || phase === "closed") return "Edits wait until the studio answers.";
  return "";
}

// --- edits ---

export async function addNode(row: Pick<FoundRow, "reference" | "name" | "port" | "title">, at: { x: number; y: number }, wire: string) {
  const { level } = studio();
  const free = await question<{ name: string }>("free_name", { level, name: row.name || row.title });
  const path = joined(level, free.name);
  const commands: Command[] = [
    { do: "Add", type: row.reference, path },
    { do: "Note", path, name: "position", value: [Math.round(at.x / 8) * 8, Math.round(at.y / 8) * 8] },
  ];
  if (wire !== "" && row.port !== "") {
    const port = `${path}.${row.port.split("/").at(-1) ?? row.port}`;
    const [source, target] = isSource(wire) ? [wire, port] : [port, wire];
    commands.push({ do: "Connect", source, target });
  }
  if (!(await edit(commands))) return;
  select([path]);
  window.dispatchEvent(new CustomEvent("hfg-show", { detail: path }));
}

/** Whether edges begin at a port, seen from the level that the page shows. */
export function isSource(port: string): boolean {
  const inner = port.endsWith(".inner");
  const plain = inner ? port.slice(0, -6) : port;
  const record = studio().tables.nodes[plain.slice(0, plain.indexOf(".", plain.lastIndexOf("/") + 1))];
  const kind = record?.ports.find((one) => one.path === plain)?.kind ?? "event";
  const out = kind === "output" || kind === "event";
  return inner ? !out : out;
}

export const connect = (source: string, target: string, active: boolean): Promise<boolean> =>
  edit([active ? { do: "Connect", source, target, active } : { do: "Connect", source, target }]);

export const disconnect = (edge: string): Promise<boolean> => {
  const [source, target] = endsOf(edge);
  return edit([{ do: "Disconnect", source, target }]);
};

export async function reconnect(edge: string, source: string, target: string): Promise<boolean> {
  const { tables } = studio();
  const [from, to] = endsOf(edge);
  if (edgeKey(source, target) === edge) return true;
  const active = tables.edges[edge]?.active ?? false;
  const options = tables.edges[edge]?.options ?? {};
  const connect: Command = { do: "Connect", source, target, ...options };
  if (active) connect.active = true;
  return edit([{ do: "Disconnect", source: from, target: to }, connect]);
}

export async function remove(paths: string[]): Promise<void> {
  const edge = studio().selectedEdge;
  if (paths.length === 0 && edge) {
    if (await disconnect(edge)) change({ selectedEdge: null });
    return;
  }
  const outer = paths.filter((path) => !paths.some((other) => other !== path && isInside(path, other)));
  await edit(outer.map((path) => ({ do: "Remove", path })));
}

/** Removes a node and joins what led to it with what came from it, where there is exactly one of each. */
export async function dissolveNode(path: string): Promise<void> {
  const edges = Object.values(studio().tables.edges);
  const into = edges.filter((edge) => edge.target.startsWith(`${path}.`));
  const from = edges.filter((edge) => edge.source.startsWith(`${path}.`));
  const commands: Command[] = [{ do: "Remove", path }];
  for (const before of into.slice(0, 1)) {
    for (const after of from) {
      const active = before.active && after.active;
      commands.push({ do: "Connect", source: before.source, target: after.target, ...(active ? { active } : {}) });
    }
  }
  await edit(commands);
}

export async function insertOn(edge: string, path: string, input: string, output: string): Promise<boolean> {
  const [source, target] = endsOf(edge);
  return edit([
    { do: "Disconnect", source, target },
    { do: "Connect", source, target: `${path}.${input}` },
    { do: "Connect", source: `${path}.${output}`, target },
  ]);
}

export async function rename(path: string, name: string): Promise<void> {
  change({ renaming: null });
  if (name === "" || name === nameOf(path)) return;
  if (await edit([{ do: "Rename", path, name }])) {
    select([joined(parentOf(path), name)]);
  }
}

export const setParameter = (path: string, value: Data, gesture: string): Promise<boolean> =>
  edit([{ do: "SetParameter", path, value }], gesture);

export async function toggleEnabled(paths: string[]): Promise<void> {
  const { nodes } = studio().tables;
  const on = paths.some((path) => !nodes[path]?.enabled);
  await edit(paths.map((path) => ({ do: on ? "Enable" : "Disable", path })));
}

/** What comes to the node goes around it; asked for again, the node takes part again. */
export async function mute(path: string): Promise<void> {
  const found = await ask<{ commands: Command[] }>({ t: "ask", what: "muted", args: { path } });
  if (found) await edit(found.commands);
}

export async function enclose(paths: string[]): Promise<void> {
  if (paths.length === 0) return;
  const { level } = studio();
  const { name } = await question<{ name: string }>("free_name", { level, name: "group" });
  if (await edit([{ do: "Enclose", paths, name }])) select([joined(level, name)]);
}

export const dissolve = (paths: string[]): Promise<boolean> => {
  const { nodes } = studio().tables;
  return edit(paths.filter((path) => nodes[path]?.subgraph).map((path) => ({ do: "Dissolve", path })));
};

export async function makeActive(edge: string): Promise<void> {
  const [source, target] = endsOf(edge);
  const active = !studio().tables.edges[edge]?.active;
  await edit([{ do: "MakeActive", source, target, active }]);
}

export async function copyAsText(paths: string[]): Promise<string> {
  const text = await question<string | { text: string }>("text", { paths });
  return typeof text === "string" ? text : text.text;
}

export async function pasteText(text: string): Promise<void> {
  const { level, tables } = studio();
  const before = new Set(Object.keys(tables.nodes));
  try {
    const { commands } = await question<{ commands: Command[] }>("paste", { text, level });
    if (!(await edit(commands))) return;
    const added = commands.flatMap((one) => (typeof one.path === "string" && /^Add/.test(one.do) ? [one.path] : []));
    select(added.filter((path) => !before.has(path) && parentOf(path) === level));
  } catch (error) {
    toast(error instanceof Error ? error.message : String(error), { kind: "bad" });
  }
}

/** Carries out an action that a node offers; gives the studio's sentence if it refuses, "" if it is done. */
export async function act(path: string, action: ActionRecord, args: Record<string, Data>): Promise<string> {
  try {
    await socket.request({ t: "act", path, name: action.name, args });
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
  }
  toast(action.label, action.undoable ? { title: "Done:", action: { label: "Undo", act: () => void undo() } } : { title: "Done:" }, 4000);
  return "";
}

export async function toggleBreak(path: string): Promise<void> {
  const set = path in studio().tables.breakpoints;
  await tell(set ? "unbreak" : "break", set ? { path } : { path, condition: null });
}

export const arrange = (paths: string[] | null): Promise<unknown> => tell("arrange", { level: studio().level, paths });

export function pin(path: string): void {
  const { pins } = studio();
  change({ pins: pins.includes(path) ? pins.filter((one) => one !== path) : [...pins, path], side: true });
}

// --- the run ---

export function pauseOrGo(): void {
  const state = studio().tables.studio.run?.state ?? "rest";
  if (state === "running" || state === "starting" || state === "stepping") void tell("pause");
  else if (state === "paused") void tell("proceed");
  else void tell("start", { stay: true });
}

let steps = 0;
/** Steps that are asked for at once: a key that is held asks no faster than they are made. */
const MOST_STEPS = 2;

export async function step(path: string): Promise<void> {
  if (steps >= MOST_STEPS) return;
  steps++;
  const answer = await ask<{ moved: string[]; why_not?: string }>({ t: "step", path });
  steps--;
  if (answer?.why_not) toast(answer.why_not);
}

/** Writes the file; without a name asks for one. Whether it is written. */
export async function save(path = "", force = false): Promise<boolean> {
  if (path === "" && studio().tables.studio.file?.can_save === false) {
    change({ popover: "open" });
    return false;
  }
  if ((await tell("save", { path, force })) === null) return false;
  toast(`Saved as ${path || studio().tables.studio.file?.name || "the file"}`, {}, 2000);
  return true;
}
