import { type KeyboardEvent, useEffect, useRef } from "react";
import { change } from "../state/studio";
import { beginAction, useOffers } from "./offers";

/** What the nodes of the graph offer to do. The page knows their words and arguments, and nothing of what they mean. */
export function ActionMenu() {
  const { actions } = useOffers();
  const root = useRef<HTMLDivElement>(null);
  const anchor = document.querySelector(".actions-button")?.getBoundingClientRect() ?? new DOMRect(200, 8, 80, 28);
  useEffect(() => {
    root.current?.querySelector("button")?.focus();
    const away = (event: PointerEvent) => {
      const on = event.target as Element;
      if (!root.current?.contains(on) && !on.closest(".actions-button")) change({ popover: null });
    };
    window.addEventListener("pointerdown", away);
    return () => window.removeEventListener("pointerdown", away);
  }, []);
  const left = Math.max(8, Math.min(anchor.left, window.innerWidth - 300));
  const top = anchor.bottom + 6;
  return (
    <div className="pop menu grows" ref={root} role="menu" aria-label="Actions" style={{ position: "fixed", left, top, zIndex: 45 }} onKeyDown={(event) => key(event, root.current)}>
      {actions.map(({ path, actions: offered }) => (
        <div key={path} role="group" aria-label={path}>
          <h3>{path}</h3>
          {offered.map((action) => (
            <button key={action.name} type="button" role="menuitem" className="two" onClick={() => beginAction(path, action, left, top)}>
              {action.label}
              {action.arguments.length > 0 && "…"}
              {action.doc !== "" && <span className="about">{action.doc}</span>}
            </button>
          ))}
        </div>
      ))}
    </div>
  );
}

function key(event: KeyboardEvent, root: HTMLElement | null): void {
  const buttons = [...(root?.querySelectorAll("button") ?? [])];
  const at = buttons.indexOf(document.activeElement as HTMLButtonElement);
  const way = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
  if (way !== 0) buttons[(at + way + buttons.length) % buttons.length]?.focus();
  if (event.key === "Escape") change({ popover: null });
  if (way === 0 && event.key !== "Escape") return;
  event.stopPropagation();
  event.preventDefault();
}
