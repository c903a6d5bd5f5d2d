import { type KeyboardEvent, useState } from "react";
import type { NodeRecord } from "../protocol/types";
import { enter, show } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";

/** The same graph as a tree: for screen readers, with the same keys, and for whoever prefers a list. */
export function Outline() {
  const open = useStudio((s) => s.panel === "outline");
  const nodes = useStudio((s) => s.tables.nodes);
  if (!open) return null;
  const levels = Map.groupBy(Object.values(nodes), (node) => node.level);
  return (
    <nav className="outline" aria-label="Outline">
      <h2>
        Outline <span className="spring" />
        <button type="button" className="btn small" aria-label="Close the outline" onClick={() => change({ panel: null })}>
          <Icon name="close" />
        </button>
      </h2>
      <ul role="tree" aria-label="Nodes" style={{ listStyle: "none", padding: 0 }} onKeyDown={key}>
        {(levels.get("") ?? []).map((node) => (
          <Branch key={node.path} node={node} levels={levels} depth={0} />
        ))}
      </ul>
    </nav>
  );
}

function Branch({ node, levels, depth }: { node: NodeRecord; levels: Map<string, NodeRecord[]>; depth: number }) {
  const [open, setOpen] = useState(depth === 0);
  const active = useStudio((s) => Object.keys(s.activity.since).some((one) => one === node.path || one.startsWith(`${node.path}/`)));
  const selected = useStudio((s) => s.selection.has(node.path));
  const inner = levels.get(node.path) ?? [];
  const edges = useStudio((s) => edgesOf(s.tables.edges, node.path));
  const says = `${node.name}, ${node.title}${active ? ", active" : ""}${node.enabled ? "" : ", disabled"}${edges}`;
  return (
    <li
      role="treeitem"
      aria-label={says}
      aria-expanded={inner.length > 0 ? open : undefined}
      aria-selected={selected}
      tabIndex={selected ? 0 : -1}
      data-outline={node.path}
      data-open={inner.length > 0 ? open : undefined}
      className={selected ? "sel" : ""}
      onClick={(event) => {
        event.stopPropagation();
        show(node.path);
      }}
      onDoubleClick={(event) => {
        event.stopPropagation();
        if (node.subgraph) enter(node.path);
      }}
    >
      <div className="label" style={{ paddingLeft: 12 + depth * 16 }}>
        {inner.length > 0 ? (
          <button
            type="button"
            className="btn small"
            style={{ height: 20, minWidth: 20, padding: 0 }}
            tabIndex={-1}
            aria-label={open ? "Fold" : "Unfold"}
            onClick={(event) => {
              event.stopPropagation();
              setOpen(!open);
            }}
          >
            <Icon name={open ? "down" : "right"} size={12} />
          </button>
        ) : (
          <span style={{ width: 20 }} />
        )}
        {active && <i className="on" />}
        {node.name}
        <span className="muted">{node.title}</span>
      </div>
      {open && inner.length > 0 && (
        <ul role="group" style={{ listStyle: "none", padding: 0 }}>
          {inner.map((one) => (
            <Branch key={one.path} node={one} levels={levels} depth={depth + 1} />
          ))}
        </ul>
      )}
    </li>
  );
}

function edgesOf(edges: Record<string, { source: string; target: string }>, path: string): string {
  const to = Object.values(edges).filter((edge) => edge.source.startsWith(`${path}.`));
  return to.length === 0 ? "" : `; leads to ${to.slice(0, 4).map((edge) => edge.target).join(", ")}`;
}

function key(event: KeyboardEvent<HTMLUListElement>): void {
  const items = [...event.currentTarget.querySelectorAll<HTMLElement>("[role=treeitem]")];
  const at = items.indexOf(document.activeElement as HTMLElement);
  const item = items[at];
  const toggle = () => item?.querySelector<HTMLElement>(":scope > .label > button")?.click();
  const moves: Record<string, () => void> = {
    ArrowDown: () => items[Math.min(items.length - 1, at + 1)]?.focus(),
    ArrowUp: () => items[Math.max(0, at - 1)]?.focus(),
    ArrowRight: () => item?.dataset.open === "false" && toggle(),
    ArrowLeft: () => item?.dataset.open === "true" && toggle(),
    Enter: () => item?.click(),
  };
  const move = moves[event.key];
  if (!move) return;
  event.preventDefault();
  event.stopPropagation();
  move();
}
