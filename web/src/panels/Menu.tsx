import { type KeyboardEvent, useEffect, useRef } from "react";
import { DOINGS } from "../keys/commands";
import type { ActionRecord } from "../protocol/types";
import { beginAction } from "../stage/offers";
import { edit, enter, locked, tell } from "../state/actions";
import { activeInside } from "../state/looking";
import { change, useStudio } from "../state/studio";

const OF_NODE = ["Rename", "Enable or disable", "Mute, or let it take part again", "Set or clear a breakpoint", "Step a firing of the selected node", "Copy as text", "Double the selection", "Make a subgraph of the selection", "Dissolve the subgraph", "Frame the selection", "Lay out the selection", "Delete", "Delete and join the wires"];
const OF_EDGE = ["Make the edge active, or passive", "Pin a probe", "Set or clear a breakpoint", "Delete"];
const OF_CANVAS = ["Add a node", "Write a note", "Paste", "Lay out all", "Show all", "Go out of the subgraph"];

const NO_ACTIONS: ActionRecord[] = [];

/** What one can do with what lies under the mouse; what cannot be done says why. */
export function Menu() {
  const menu = useStudio((s) => s.menu);
  const node = useStudio((s) => (menu?.kind === "node" ? s.tables.nodes[menu.path] : undefined));
  const active = useStudio((s) => menu !== null && menu.path in s.activity.since);
  const inside = useStudio((s) => menu !== null && activeInside(s.activity, menu.path) !== null);
  const actions = useStudio((s) => s.tables.types[node?.type ?? ""]?.actions) ?? NO_ACTIONS;
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!menu) return;
    root.current?.querySelector("button")?.focus();
    const away = (event: PointerEvent) => {
      if (!root.current?.contains(event.target as Node)) change({ menu: null });
    };
    window.addEventListener("pointerdown", away);
    return () => window.removeEventListener("pointerdown", away);
  }, [menu]);
  if (!menu) return null;
  const names = menu.kind === "node" ? OF_NODE : menu.kind === "edge" ? OF_EDGE : OF_CANVAS;
  const key = (event: KeyboardEvent) => {
    const buttons = [...(root.current?.querySelectorAll("button") ?? [])];
    const at = buttons.indexOf(document.activeElement as HTMLButtonElement);
    const way = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (way !== 0) buttons[(at + way + buttons.length) % buttons.length]?.focus();
    if (event.key === "Escape") change({ menu: null });
    if (way !== 0 || event.key === "Escape") {
      event.stopPropagation();
      event.preventDefault();
    }
  };
  const left = Math.min(menu.x, window.innerWidth - 300);
  const top = Math.min(menu.y, window.innerHeight - 34 - 26 * (names.length + actions.length + 4));
  const begin = node?.ports.find((port) => port.kind === "slot");
  return (
    <div className="pop menu grows" ref={root} role="menu" style={{ position: "fixed", left, top: Math.max(8, top), zIndex: 45 }} onKeyDown={key}>
      {node?.subgraph && <Item name="Go into the subgraph" keys="Enter" off="" run={() => enter(node.path)} />}
      {names.map((name) => {
        const doing = DOINGS.find((one) => one.name === name)!;
        return <Item key={name} name={name} keys={doing.keys} off={doing.off?.() ?? ""} run={doing.run} />;
      })}
      {actions.length > 0 && (
        <>
          <hr />
          {actions.map((action) => (
            <Item key={action.name} name={`${action.label}…`} keys="" off={locked()} run={() => beginAction(menu.path, action, left, top)} />
          ))}
        </>
      )}
      {node?.activity && (
        <>
          <hr />
          {begin && !active && <Item name="Give it the activity" keys="" off="" run={() => void tell("trigger", { path: begin.path, activity: 1 })} />}
          {(active || inside) && <Item name="Take the activity away" keys="" off={locked()} run={() => void tell("trigger", { path: `${node.path}.deactivate`, value: true })} />}
          {node.own_group !== null && <Item name="Let it run where what is around it runs" keys="" off="" run={() => void edit([{ do: "Move", path: node.path, group: null }])} />}
        </>
      )}
    </div>
  );
}

function Item({ name, keys, off, run }: { name: string; keys: string; off: string; run: () => void }) {
  const act = () => {
    if (off !== "") return;
    change({ menu: null });
    run();
  };
  return (
    <button type="button" role="menuitem" aria-disabled={off !== ""} title={off || undefined} onClick={act}>
      {name}
      {keys !== "" && <kbd>{keys.replaceAll("+", " ")}</kbd>}
    </button>
  );
}
