import { useEffect, useState } from "react";
import type { Command, Data, Value } from "../protocol/types";
import { ask, edit, locked, pin, show } from "../state/actions";
import { saveValue } from "../state/capturing";
import { socket } from "../state/link";
import { valueSeen } from "../state/looking";
import { nodeOf } from "../state/paths";
import { layoutKey, studio, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { moment, rate, short } from "../ui/words";
import { ImageView } from "./ImageView";
import { Plot } from "./Plot";

/** What goes over a port or an edge, as the kind of its values asks for: image, plot, table or text. */
export function Probe({ path }: { path: string }) {
  const [value, setValue] = useState<Value | null>(null);
  const [why, setWhy] = useState("");
  const port = useStudio((s) => s.tables.nodes[nodeOf(path)]?.ports.find((one) => one.path === path));
  const used = port?.used;
  useEffect(() => {
    setWhy("");
    return socket.subscribe("value", { path }, 4, (next, time) => setValue((before) => orBefore(valueSeen(next, time), before)), setWhy).end;
  }, [path, used]);
  const loose = port?.kind === "output" && !used;
  const shape = value?.shape ? ` · ${[...value.shape].join("×")}` : "";
  return (
    <section className="probe" aria-label={`Probe of ${path}`}>
      <header>
        <button type="button" className="btn small" style={{ padding: 0 }} aria-label={`Unpin ${path}`} onClick={() => pin(path)}>
          <Icon name="pin" />
        </button>
        <b>{path.replace(" -> ", " → ")}</b>
        <span className="sp" />
        <span className="r num">{value ? `${value.kind === "number" ? value.summary : rate(value.rate_hz)}${shape}` : ""}</span>
      </header>
      {value && value.kind !== "none" && value.kind !== "marker" && <Saving path={path} kind={value.kind} />}
      {loose ? <Loose path={path} /> : value ? <Body path={path} value={value} /> : <div className="text">{why || "Nothing was sent yet."}</div>}
    </section>
  );
}

/** What was sent before a port fell silent stays to be seen, at its time. */
const orBefore = (next: Value | null, before: Value | null): Value | null =>
  next?.kind === "marker" && before !== null && before.kind !== "none" ? { ...before, rate_hz: next.rate_hz } : next;

/** Nothing takes what this output sends, so nothing passes there that one could see. */
function Loose({ path }: { path: string }) {
  const why = locked();
  const add = async () => {
    const found = await ask<{ commands: Command[] }>({ t: "ask", what: "shown_by", args: { path } });
    if (!found) return;
    const added = found.commands.find((one) => one.do === "Add")?.path;
    const beside = typeof added === "string" ? besideOf(nodeOf(path), added) : [];
    if (!(await edit([...found.commands, ...beside]))) return;
    if (typeof added === "string") show(added);
  };
  return (
    <div className="text" style={{ fontFamily: "inherit" }}>
      <p>Nothing takes what it sends, so there is nothing to see.</p>
      <button type="button" className="btn line" disabled={why !== ""} title={why || undefined} onClick={() => void add()}>
        Add a node that shows it
      </button>
    </div>
  );
}

const APART = 64;

/** Puts a new node to the right of one that a person has put in its place; the layout finds a place for all others. */
function besideOf(node: string, added: string): Command[] {
  const layout = studio().tables.layouts[layoutKey(studio())];
  const box = layout?.nodes.find((one) => one.id === node);
  return box && layout?.fixed.includes(node) ? [{ do: "Note", path: added, name: "position", value: [box.x + box.width + APART, box.y] }] : [];
}

/** The next value that passes, as a file. */
function Saving({ path, kind }: { path: string; kind: Value["kind"] }) {
  const arrays = kind === "array" || kind === "image" || kind === "number";
  return (
    <div className="saving">
      <span className="muted">Save the next value as</span>
      <button type="button" className="btn small" aria-label={`Save a value of ${path} as CSV`} onClick={() => void saveValue(path, "csv")}>
        CSV
      </button>
      {arrays && (
        <button type="button" className="btn small" aria-label={`Save a value of ${path} as NPY`} onClick={() => void saveValue(path, "npy")}>
          NPY
        </button>
      )}
    </div>
  );
}

function Body({ path, value }: { path: string; value: Value }) {
  if (value.message !== "") return <div className="text">{value.message}</div>;
  switch (value.kind) {
    case "marker":
      return <div className="text">Silent: the last firing sent nothing here.</div>;
    case "image":
      return <ImageView path={path} caption={`${value.summary} · ${moment(value.time)}`} />;
    case "number":
      return <Plot path={path} />;
    case "table":
    case "record":
      return <Table data={value.data} />;
    default:
      return <div className="text num">{value.data === null || value.data === undefined ? value.summary : pretty(value.data)}</div>;
  }
}

const pretty = (data: Data): string => (typeof data === "object" ? JSON.stringify(data, null, 1) : String(data));

function Table({ data }: { data: Data }) {
  const rows = Array.isArray(data) ? data : [data];
  const first = rows.find((row) => row !== null && typeof row === "object" && !Array.isArray(row)) as Record<string, Data> | undefined;
  const names = first ? Object.keys(first) : [];
  if (names.length === 0) return <div className="text num">{pretty(data)}</div>;
  if (rows.length === 1) {
    return (
      <table className="num">
        <tbody>
          {names.map((name) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              <td>{short(first![name])}</td>
            </tr>
          ))}
        </tbody>
      </table>
    );
  }
  return (
    <table className="num">
      <thead>
        <tr>
          {names.map((name) => (
            <th key={name}>{name}</th>
          ))}
        </tr>
      </thead>
      <tbody>
        {rows.slice(0, 20).map((row, index) => (
          <tr key={`${index}`}>
            {names.map((name) => (
              <td key={name}>{short((row as Record<string, Data>)[name])}</td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
