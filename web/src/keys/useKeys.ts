import { useEffect } from "react";
import { chosen, edit, locked, newGesture, select, toast } from "../state/actions";
import { isRecording } from "../state/looking";
import { edgeKey, endsOf, nodeOf } from "../state/paths";
import { change, layoutKey, studio } from "../state/studio";
import { DOINGS, written } from "./commands";

const BY_KEYS = new Map(DOINGS.filter((one) => one.keys !== "").map((one) => [one.keys, one]));
const REGIONS = ["#top button", "#rail button", "#canvas", "#side .scroll", "#time .tab"];

const isTyping = (target: EventTarget | null): boolean =>
  target instanceof HTMLElement && target.matches("input:not([type=checkbox]), select, textarea, [contenteditable]");

/** Keys for everything, wherever the focus is; in a field only those with Ctrl that fields have no use for. */
export function useKeys(): void {
  useEffect(() => {
    const down = (event: KeyboardEvent) => {
      const keys = written(event);
      if (isTyping(event.target)) {
        if (!["Ctrl+K", "Ctrl+S", "Ctrl+O"].includes(keys)) return;
      }
      if (event.key === "F6") {
        event.preventDefault();
        nextRegion(event.shiftKey ? -1 : 1);
        return;
      }
      if (studio().popover !== null && keys !== "Escape") return;
      const arrow = ARROWS[event.key];
      const steps = arrow?.[1] === 0 && !event.shiftKey && isRecording(studio().tables.studio.run);
      if (arrow && !event.ctrlKey && !steps) {
        if (event.shiftKey) moveBy(arrow[0] * 8, arrow[1] * 8, event.repeat);
        else if (!along(arrow)) return;
        event.preventDefault();
        return;
      }
      if (keys === "Tab" && !inCanvas()) return;
      const pressed = event.target as HTMLElement;
      if ((keys === "Space" || keys === "Enter") && pressed.matches?.("button, summary, [role=treeitem], input")) return;
      const doing = BY_KEYS.get(keys) ?? (keys === "Ctrl+Y" ? BY_KEYS.get("Ctrl+Shift+Z") : undefined);
      if (!doing) return;
      if (keys === "Ctrl+C" && window.getSelection()?.toString()) return;
      event.preventDefault();
      const why = doing.off?.() ?? "";
      if (why === "") doing.run();
      else if (chosen().length > 0 || locked() !== "") toast(why, { kind: "warn" }, 3000);
    };
    window.addEventListener("keydown", down);
    return () => window.removeEventListener("keydown", down);
  }, []);
}

const ARROWS: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function inCanvas(): boolean {
  const focus = document.activeElement;
  return focus === null || focus === document.body || document.getElementById("canvas")?.contains(focus) === true;
}

function nextRegion(way: number): void {
  const focus = document.activeElement;
  const elements = REGIONS.map((one) => document.querySelector<HTMLElement>(one));
  const now = elements.findIndex((one) => one !== null && focus !== null && (one === focus || region(one)?.contains(focus)));
  const next = elements[(now + way + elements.length) % elements.length];
  if (next?.id === "canvas") next.tabIndex = -1;
  next?.focus();
}

const region = (element: HTMLElement): Element | null => element.closest("#top, #rail, #canvas, #side, #time");

let gesture = "";

function moveBy(dx: number, dy: number, repeated: boolean): void {
  const state = studio();
  const layout = state.tables.layouts[layoutKey(state)];
  if (!layout || locked() !== "") return;
  if (!repeated) gesture = newGesture();
  const boxes = layout.nodes.filter((box) => state.selection.has(box.id));
  void edit(
    boxes.map((box) => ({ do: "Note", path: box.id, name: "position", value: [box.x + dx, box.y + dy] })),
    gesture,
  );
}

/** Along an edge to the next node that lies that way; without an edge there, to the nearest one. */
function along([dx, dy]: [number, number]): boolean {
  const state = studio();
  const layout = state.tables.layouts[layoutKey(state)];
  const here = layout?.nodes.find((box) => state.selection.has(box.id));
  if (!layout) return false;
  if (!here) {
    const first = layout.nodes[0];
    if (first) select([first.id]);
    return first !== undefined;
  }
  const joined = new Set(
    Object.values(state.tables.edges).flatMap((edge) => {
      const [source, target] = endsOf(edgeKey(edge.source, edge.target)).map(nodeOf);
      return source === here.id ? [target] : target === here.id ? [source] : [];
    }),
  );
  const distance = (box: typeof here) => {
    const [x, y] = [box.x + box.width / 2 - here.x - here.width / 2, box.y + box.height / 2 - here.y - here.height / 2];
    const ahead = x * dx + y * dy;
    return ahead <= 4 ? Number.POSITIVE_INFINITY : ahead + 2 * Math.abs(x * dy + y * dx) + (joined.has(box.id) ? 0 : 10_000);
  };
  const next = layout.nodes.filter((box) => box !== here).sort((a, b) => distance(a) - distance(b))[0];
  if (!next || distance(next) === Number.POSITIVE_INFINITY) return true;
  select([next.id]);
  window.dispatchEvent(new CustomEvent("hfg-show", { detail: next.id }));
  change({ announced: next.name });
  return true;
}
