import { useEffect, useState } from "react";
import { ask, question } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { CARD_PICTURES } from "./pictures";

interface Start {
  folder: string;
  files: { name: string; kind: string; changed: number }[];
  runs: string[];
}

const MOST_CARDS = 12;

/** Nothing is open: what can be opened here, and an empty graph. */
export function StartPage() {
  const folder = useStudio((s) => s.tables.studio.file?.folder ?? "");
  const [start, setStart] = useState<Start>({ folder: "", files: [], runs: [] });
  useEffect(() => {
    question<Start>("start", {}).then(setStart, () => undefined);
  }, []);
  const files = [...start.files].sort((a, b) => b.changed - a.changed).slice(0, MOST_CARDS);
  return (
    <main className="start">
      <div className="in">
        <div style={{ display: "flex", alignItems: "flex-end", gap: 24, marginBottom: 24 }}>
          <div>
            <h1 style={{ font: "600 24px/32px var(--font)", margin: 0 }}>Open a graph, or begin one</h1>
            <p style={{ marginTop: 4, fontSize: 13, lineHeight: "20px", color: "var(--ink2)" }}>
              Files come from <b>{start.folder || folder}</b>. Nothing leaves this machine.
            </p>
          </div>
          <span className="spring" />
          <button type="button" className="btn line" style={{ height: 32, padding: "0 12px" }} onClick={() => change({ popover: "open" })}>
            <Icon name="file" />
            Open a file <kbd>Ctrl O</kbd>
          </button>
          <button type="button" className="btn primary" style={{ height: 32 }} onClick={() => change({ begun: true })}>
            <Icon name="plus" />
            New graph
          </button>
        </div>
        <h2 className="start-head">In this folder</h2>
        {files.length === 0 && <p className="second">No graph files yet. What you save appears here.</p>}
        <div className="cards">
          {files.map((one, index) => (
            <button type="button" className="card" key={one.name} onClick={() => void ask({ t: "open", path: one.name, discard: false })}>
              <span className="pic">{CARD_PICTURES[index % CARD_PICTURES.length]}</span>
              <span className="tx">
                <b>{one.name}</b>
                <p>{one.kind === "yaml" ? "graph file" : one.kind}</p>
              </span>
            </button>
          ))}
        </div>
        <h2 className="start-head" style={{ marginTop: 32 }}>
          Runs on this machine
        </h2>
        {start.runs.length === 0 ? (
          <p className="second">
            None. A graph that was started by <span className="mono">hfg run</span> appears here.
          </p>
        ) : (
          start.runs.map((name) => <p key={name}>{name}</p>)
        )}
      </div>
    </main>
  );
}
