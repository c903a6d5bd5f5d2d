import { useEffect, useState } from "react";
import type { Command, Data, Value } from "../protocol/types";
import { ask, edit, locked, pin, show } from "../state/actions";
import { saveValue } from "../state/capturing";
import { socket } from "../state/link";
import { valueSeen } from "../state/looking";
import { nodeOf } from "../state/paths";
import { useStudio } from "../state/studio";
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
    return socket.subscribe("value", { path }, 4, (next, time) => setValue(valueSeen(next, time)), setWhy).end;
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

/** Nothing takes what this output sends, so nothing passes there that one could see. */
function Loose({ path }: { path: string }) {
  const why = locked();
  const add = async () => {
    const found = await ask<{ commands: Command[] }>({ t: "ask", what: "shown_by", args: { path } });
    if (!found || !(await edit(found.commands))) return;
    const added = found.commands.find((one) => one.do === "Add")?.path;
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
