import { type KeyboardEvent, useEffect, useState } from "react";
import type { Command, Fit } from "../protocol/types";
import { connect, edit, isSource, question, toast } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { askTargets, type Judged, reasonOf } from "../state/targets";

interface Row {
  port: string;
  says: string;
  off: boolean;
  commands?: Command[];
}

/** Ports outside of the subgraph, and what leads there. */
interface WaysOut {
  rows: { port: string; commands: Command[] }[];
  message: string;
}

/** Connects without a mouse: choose a port of the node, then one that takes it. */
export function Connect() {
  const path = useStudio((s) => [...s.selection][0] ?? "");
  const ports = useStudio((s) => s.tables.nodes[path]?.ports);
  const [from, setFrom] = useState("");
  const [targets, setTargets] = useState<Judged | null>(null);
  const [out, setOut] = useState<WaysOut | null>(null);
  const [index, setIndex] = useState(0);
  useEffect(() => {
    if (from === "") return;
    question<WaysOut>("ways_out", { path: from }).then(setOut, () => undefined);
    askTargets(from, "").then(setTargets, (error: Error) => toast(error.message, { kind: "bad" }));
  }, [from]);
  const rows: Row[] =
    from === ""
      ? (ports ?? []).map((port) => ({ port: port.path, says: `${port.kind} ${port.type}`, off: false }))
      : [
          ...[...(targets?.ports ?? [])]
            .sort(([, a], [, b]) => ORDER.indexOf(a.fit) - ORDER.indexOf(b.fit))
            .map(([port, fit]) => ({ port, says: says(fit, port), off: fit.fit === "refused" })),
          ...(out?.rows ?? []).map((row) => ({ port: row.port, says: "outside: the subgraph gets a port for it", off: false, commands: row.commands })),
          ...(out?.message ? [{ port: "Outside", says: out.message, off: true }] : []),
        ].sort((a, b) => Number(a.off) - Number(b.off));
  const close = () => change({ popover: null });
  const take = (row: Row | undefined) => {
    if (!row || row.off) return;
    setIndex(0);
    if (from === "") {
      setFrom(row.port);
      return;
    }
    close();
    if (row.commands) void edit(row.commands);
    else void (isSource(from) ? connect(from, row.port, false) : connect(row.port, from, false));
  };
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    if (event.key === "Escape") close();
    if (event.key === "ArrowDown") setIndex(Math.min(rows.length - 1, index + 1));
    if (event.key === "ArrowUp") setIndex(Math.max(0, index - 1));
    if (event.key === "Enter") take(rows[index]);
    if (event.key.startsWith("Arrow") || event.key === "Tab") event.preventDefault();
  };
  return (
    <div className="veil" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop palette commands grows" role="dialog" aria-label="Connect" onKeyDown={key}>
        <div className="in">{from === "" ? `Which port of ${path}?` : `Where does ${from} lead?`}</div>
        <ul role="listbox" aria-label="Ports" tabIndex={0} ref={(list) => list?.focus()}>
          {rows.map((row, at) => (
            <li
              key={row.port}
              role="option"
              aria-selected={at === index}
              aria-disabled={row.off}
              className={`${at === index ? "sel" : ""}${row.off ? " no" : ""}`}
              onClick={() => take(row)}
            >
              <b>{row.port}</b>
              <div>{row.says}</div>
            </li>
          ))}
        </ul>
      </div>
    </div>
  );
}

const ORDER: Fit["fit"][] = ["expects", "takes", "refused"];

function says(fit: Fit, port: string): string {
  if (fit.fit === "refused") return `${reasonOf(fit, port)}; ${fit.remedy}`;
  return fit.fit === "expects" ? `expects ${fit.expected || "it"}` : "takes anything";
}
