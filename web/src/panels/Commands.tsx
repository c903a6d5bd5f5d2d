import { type KeyboardEvent, useMemo, useState } from "react";
import { DOINGS } from "../keys/commands";
import { show } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";

interface Row {
  id: string;
  name: string;
  says: string;
  keys: string;
  off: string;
  run: () => void;
}

const MOST = 60;

/** Find or do anything: nodes, ports, parameters and every command with its key. */
export function Commands() {
  const nodes = useStudio((s) => s.tables.nodes);
  const [words, setWords] = useState("");
  const [index, setIndex] = useState(0);
  const rows = useMemo(() => found(words, nodes), [words, nodes]);
  const close = () => change({ popover: null });
  const run = (row: Row | undefined) => {
    if (!row || row.off !== "") return;
    close();
    row.run();
  };
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    if (event.key === "Escape") close();
    if (event.key === "ArrowDown") setIndex(Math.min(rows.length - 1, index + 1));
    if (event.key === "ArrowUp") setIndex(Math.max(0, index - 1));
    if (event.key === "Enter") run(rows[index]);
    if (event.key.startsWith("Arrow") || event.key === "Tab") event.preventDefault();
  };
  return (
    <div className="veil" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop palette commands grows" role="dialog" aria-label="Find or do anything" onKeyDown={key}>
        <div className="in">
          <Icon name="find" />
          <input
            autoFocus
            value={words}
            placeholder="Find or do anything"
            aria-label="Find or do anything"
            role="combobox"
            aria-expanded="true"
            aria-controls="command-rows"
            onChange={(event) => {
              setWords(event.target.value);
              setIndex(0);
            }}
          />
        </div>
        <ul id="command-rows" role="listbox" aria-label="Nodes and commands">
          {rows.map((row, at) => (
            <li
              key={row.id}
              role="option"
              aria-selected={at === index}
              aria-disabled={row.off !== ""}
              className={`${at === index ? "sel" : ""}${row.off === "" ? "" : " no"}`}
              onPointerMove={() => at !== index && setIndex(at)}
              onClick={() => run(row)}
            >
              {row.keys !== "" && <kbd className="keys">{row.keys.replaceAll("+", " ")}</kbd>}
              <b>{row.name}</b>
              <div>{row.off || row.says}</div>
            </li>
          ))}
          {rows.length === 0 && (
            <li className="hd" role="option" aria-selected="false">
              Nothing is called “{words}”.
            </li>
          )}
        </ul>
        <div className="ft">
          <span>
            <kbd>Enter</kbd> go there, or do it
          </span>
          <span className="spring" />
          <span className="num">{rows.length}</span>
        </div>
      </div>
    </div>
  );
}

function found(words: string, nodes: Record<string, { path: string; title: string; ports: { name: string; path: string; type: string }[]; parameters: object }>): Row[] {
  const wanted = words.trim().toLowerCase();
  const doings = DOINGS.map((one) => ({ id: `do-${one.name}`, name: one.name, says: "", keys: one.keys, off: one.off?.() ?? "", run: one.run }));
  if (wanted === "") return doings.filter((one) => one.off === "");
  const places: Row[] = [];
  for (const node of Object.values(nodes)) {
    const go = () => show(node.path);
    if (node.path.toLowerCase().includes(wanted) || node.title.toLowerCase().includes(wanted)) {
      places.push({ id: node.path, name: node.path.split("/").join(" › "), says: node.title, keys: "", off: "", run: go });
    }
    for (const name of [...node.ports.map((port) => port.name), ...Object.keys(node.parameters)]) {
      if (places.length > MOST) break;
      if (name.toLowerCase().includes(wanted)) {
        places.push({ id: `${node.path}.${name}`, name, says: `of ${node.path}`, keys: "", off: "", run: go });
      }
    }
  }
  const commands = doings.filter((one) => one.name.toLowerCase().includes(wanted));
  const unique = new Map([...places, ...commands].map((row) => [row.id, row]));
  return [...unique.values()].slice(0, MOST);
}
