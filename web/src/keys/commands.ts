import type { View } from "../state/studio";
import { change, isNarrow, studio } from "../state/studio";
import { seek, stepTo } from "../live/replay";
import { isRecording } from "../state/looking";
import * as act from "../state/actions";
import { addAnnotation, removeAnnotation } from "../state/annotating";
import type { Alignment } from "../state/aligning";
import { align, distribute, selectedBoxes } from "../state/arranging";
import { savePng, saveSvg } from "../state/capturing";
import { record, useWindow } from "../timeline/store";

/** A thing that one can do: in the palette of commands, on keys, in menus. One list, so that no key is a secret. */
export interface Doing {
  name: string;
  keys: string;
  /** Why it cannot be done now; "" if it can. */
  off?: () => string;
  run: () => void;
}

const none = () => (act.chosen().length === 0 ? "Choose a node first." : "");
const noEdge = () => (studio().selectedEdge === null ? "Choose an edge first." : "");
const first = () => act.chosen()[0] ?? "";
const several = (least: number) => () => (selectedBoxes().length < least ? `Choose ${least} nodes or more first.` : "");
const nothing = () => (none() && noEdge() && studio().annotation === null ? "Choose a node or an edge first." : "");
const edits = (more: () => string = () => "") => () => act.locked() || more();
const view = (one: View) => () => act.choose(one);

export const ALIGNMENTS: [Alignment, string][] = [
  ["left", "Align left sides"],
  ["centre", "Align centres"],
  ["right", "Align right sides"],
  ["top", "Align upper sides"],
  ["middle", "Align middles"],
  ["bottom", "Align lower sides"],
];

/** A frame goes, what is in it stays. */
function remove(): void {
  const { annotation } = studio();
  if (annotation !== null) void removeAnnotation(annotation);
  else void act.remove(act.chosen());
}

async function copy(): Promise<void> {
  await navigator.clipboard.writeText(await act.copyAsText(act.chosen()));
  act.toast(`Copied as text: ${act.chosen().length === 1 ? "1 node" : `${act.chosen().length} nodes`}`, {}, 2000);
}

const paste = async () => act.pasteText(await navigator.clipboard.readText());
const twice = async () => act.pasteText(await act.copyAsText(act.chosen()));

function toActivityChange(way: 1 | -1): void {
  const { follows, end, length } = useWindow.getState();
  const now = record.cursor ?? (follows ? record.now : end);
  const times = record.spans.map((span) => span[1]).sort((a, b) => a - b);
  const next = way === 1 ? times.find((time) => time > now + 1e-6) : times.findLast((time) => time < now - 1e-6);
  if (next === undefined) return;
  if (record.cursor === null) useWindow.setState({ follows: false, end: next, length });
  else seek(next);
}

function followOrNot(): void {
  const { follows, end } = useWindow.getState();
  useWindow.setState({ follows: !follows, end: record.cursor === null ? record.now : end });
}

const replays = () => act.unsteerable() || (isRecording(studio().tables.studio.run) ? "" : "Only a recording goes back.");

function leaveSomething(): void {
  const { menu, popover, acting, selectedEdge, annotation, selection, panel, level, side } = studio();
  if (menu || popover || acting) change({ menu: null, popover: null, palette: null, acting: null });
  else if (side && isNarrow()) change({ side: false }); // it lies over the graph
  else if (selection.size > 0 || selectedEdge || annotation) act.select([]);
  else if (panel) change({ panel: null });
  else if (level !== "") act.leave();
}

export const DOINGS: Doing[] = [
  { name: "Add a node", keys: "Tab", off: edits(), run: () => window.dispatchEvent(new CustomEvent("hfg-add")) },
  { name: "Find or do anything", keys: "Ctrl+K", run: () => change({ popover: "commands" }) },
  { name: "Pause, go on, start", keys: "Space", off: act.unsteerable, run: act.pauseOrGo },
  { name: "To the firing before, of a recording", keys: "ArrowLeft", off: replays, run: () => void stepTo(true) },
  { name: "To the next firing, of a recording", keys: "ArrowRight", off: replays, run: () => void stepTo(false) },
  { name: "Step a wave", keys: ".", off: act.unsteerable, run: () => void act.step("") },
  { name: "Step a firing of the selected node", keys: ",", off: () => act.unsteerable() || none(), run: () => void act.step(first()) },
  { name: "Stop the run", keys: "Shift+Escape", off: edits(), run: () => void act.tell("stop") },
  { name: "Reset the activity", keys: "", off: edits(), run: () => void act.tell("reset") },
  { name: "Set or clear a breakpoint", keys: "F9", off: nothing, run: () => void act.toggleBreak(first() || studio().selectedEdge!) },
  { name: "Undo", keys: "Ctrl+Z", off: edits(), run: () => void act.undo() },
  { name: "Redo", keys: "Ctrl+Shift+Z", off: edits(), run: () => void act.redo() },
  { name: "Copy as text", keys: "Ctrl+C", off: none, run: () => void copy() },
  { name: "Paste", keys: "Ctrl+V", off: edits(), run: () => void paste() },
  { name: "Double the selection", keys: "Ctrl+D", off: edits(none), run: () => void twice() },
  { name: "Make a subgraph of the selection", keys: "Ctrl+G", off: edits(none), run: () => void act.enclose(act.chosen()) },
  { name: "Dissolve the subgraph", keys: "Ctrl+Shift+G", off: edits(none), run: () => void act.dissolve(act.chosen()) },
  { name: "Delete", keys: "Delete", off: edits(nothing), run: remove },
  { name: "Delete and join the wires", keys: "Ctrl+Delete", off: edits(none), run: () => void act.dissolveNode(first()) },
  { name: "Rename", keys: "F2", off: edits(none), run: () => change({ renaming: first() }) },
  { name: "Enable or disable", keys: "E", off: edits(none), run: () => void act.toggleEnabled(act.chosen()) },
  { name: "Mute, or let it take part again", keys: "M", off: edits(none), run: () => void act.mute(first()) },
  { name: "Make the edge active, or passive", keys: "A", off: edits(noEdge), run: () => void act.makeActive(studio().selectedEdge!) },
  { name: "Connect: choose a port, then the other", keys: "C", off: edits(none), run: () => change({ popover: "connect" }) },
  { name: "Pin a probe", keys: "P", off: noEdge, run: () => act.pin(studio().selectedEdge!) },
  { name: "Write a note", keys: "N", off: edits(), run: () => window.dispatchEvent(new CustomEvent("hfg-note")) },
  { name: "Frame the selection", keys: "Ctrl+J", off: edits(none), run: () => void addAnnotation({ kind: "frame", paths: act.chosen() }) },
  ...ALIGNMENTS.map(([way, name]) => ({ name, keys: "", off: edits(several(2)), run: () => align(way) })),
  { name: "Distribute from left to right", keys: "", off: edits(several(3)), run: () => distribute("x") },
  { name: "Distribute from top to bottom", keys: "", off: edits(several(3)), run: () => distribute("y") },
  { name: "Lay out all", keys: "", off: edits(), run: () => void act.arrange(null) },
  { name: "Lay out the selection", keys: "", off: edits(none), run: () => void act.arrange(act.chosen()) },
  { name: "Go into the subgraph", keys: "Enter", off: none, run: () => studio().tables.nodes[first()]?.subgraph && act.enter(first()) },
  { name: "Go out of the subgraph", keys: "Backspace", run: act.leave },
  { name: "Show the selection", keys: "F", off: none, run: () => act.show(first()) },
  { name: "Show all", keys: "Home", run: () => window.dispatchEvent(new CustomEvent("hfg-show-all")) },
  { name: "View: activity", keys: "1", run: view("activity") },
  { name: "View: mission", keys: "2", run: view("mission") },
  { name: "View: all edges", keys: "3", run: view("all") },
  { name: "Open all subgraphs, or close them", keys: "U", run: act.openAll },
  { name: "Follow live", keys: "L", run: followOrNot },
  { name: "To the change of activity before", keys: "[", run: () => toActivityChange(-1) },
  { name: "To the change of activity after", keys: "]", run: () => toActivityChange(1) },
  { name: "Outline", keys: "O", run: () => change({ panel: studio().panel === "outline" ? null : "outline" }) },
  { name: "States", keys: "S", run: () => change({ panel: studio().panel === "states" ? null : "states" }) },
  { name: "Timeline", keys: "T", run: () => change({ time: !studio().time }) },
  { name: "Views of nodes", keys: "V", run: () => change({ stage: !studio().stage }) },
  { name: "Actions of nodes", keys: "X", off: edits(), run: () => change({ popover: "actions" }) },
  { name: "Inspector", keys: "I", run: () => change({ side: !studio().side }) },
  { name: "Light or dark", keys: "", run: () => change({ theme: studio().theme === "dark" ? "light" : "dark" }) },
  { name: "Save a picture of this level as SVG", keys: "", run: () => void saveSvg() },
  { name: "Save a picture of this level as PNG", keys: "", run: () => void savePng() },
  { name: "Save", keys: "Ctrl+S", off: edits(), run: () => void act.save() },
  { name: "Open or save as", keys: "Ctrl+O", off: act.unsteerable, run: () => change({ popover: "open" }) },
  { name: "Keys", keys: "?", run: () => change({ popover: "keys" }) },
  { name: "Leave what was begun, then the selection, then the level", keys: "Escape", run: leaveSomething },
];

/** The way a key event is written in the list. */
export function written(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey">): string {
  const key = event.key === " " ? "Space" : event.key.length === 1 ? event.key.toUpperCase() : event.key;
  const parts = [];
  if (event.ctrlKey || event.metaKey) parts.push("Ctrl");
  if (event.shiftKey && (key.length > 1 || event.ctrlKey || event.metaKey)) parts.push("Shift");
  return [...parts, key].join("+");
}
