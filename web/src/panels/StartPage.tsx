import { useEffect, useState } from "react";
import { ask, question } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { CARD_PICTURES } from "./pictures";

interface Start {
  folder: string;
  examples: { name: string; path: string; title: string; text: string; nodes: number; picture?: string }[];
  recent: { name: string; path: string }[];
  runs: { name: string; path?: string }[];
}

export function StartPage() {
  const folder = useStudio((s) => s.tables.studio.file?.folder ?? "");
  const [start, setStart] = useState<Start | null>(null);
  useEffect(() => {
    question<Start>("start", {}).then(setStart, () => setStart({ folder: "", examples: [], recent: [], runs: [] }));
  }, []);
  const open = (path: string) => void ask({ t: "open", path, discard: false });
  const [first, ...others] = start?.examples ?? [];
  return (
    <main className="start">
      <div className="in">
        <div style={{ display: "flex", alignItems: "flex-end", gap: 24, marginBottom: 24 }}>
          <div>
            <h1 style={{ font: "600 24px/32px var(--font)", margin: 0 }}>Open a graph, or see one run</h1>
            <p style={{ marginTop: 4, fontSize: 13, lineHeight: "20px", color: "var(--ink2)" }}>
              Files come from <b>{start?.folder || folder}</b>. Nothing leaves this machine.
            </p>
          </div>
          <span className="spring" />
          <button type="button" className="btn line" style={{ height: 32, padding: "0 12px" }} onClick={() => change({ popover: "open" })}>
            <Icon name="file" />
            Open a file <kbd>Ctrl O</kbd>
          </button>
          <button type="button" className="btn primary" style={{ height: 32 }} onClick={() => change({ popover: "open" })}>
            <Icon name="plus" />
            New graph
          </button>
        </div>
        {first && (
          <button type="button" className="card wide-card" onClick={() => open(first.path)}>
            <span className="pic">{CARD_PICTURES[0]}</span>
            <span className="tx">
              <b style={{ fontSize: 17, lineHeight: "24px" }}>{first.title}</b>
              <p style={{ fontSize: 13, lineHeight: "20px" }}>{first.text}</p>
              <small>{first.nodes} nodes</small>
            </span>
          </button>
        )}
        <h2 className="start-head">Start from something small</h2>
        <div className="cards">
          {others.map((one, index) => (
            <button type="button" className="card" key={one.path} onClick={() => open(one.path)}>
              <span className="pic">{CARD_PICTURES[(index % (CARD_PICTURES.length - 1)) + 1]}</span>
              <span className="tx">
                <b>{one.title}</b>
                <p>{one.text}</p>
                <small>
                  {one.name} · {one.nodes} nodes
                </small>
              </span>
            </button>
          ))}
        </div>
        <div style={{ display: "grid", gridTemplateColumns: "1fr 1fr", gap: 32, marginTop: 32 }}>
          <div>
            <h2 className="start-head">Opened before</h2>
            {start?.recent.length ? start.recent.map((one) => <Link key={one.path} name={one.name} act={() => open(one.path)} />) : <p className="second">Nothing yet. Graphs that you open appear here.</p>}
          </div>
          <div>
            <h2 className="start-head">Runs on this machine</h2>
            {start?.runs.length ? start.runs.map((one) => <p key={one.name}>{one.name}</p>) : <p className="second">None. A graph that was started by <span className="mono">hfg run</span> appears here.</p>}
          </div>
        </div>
      </div>
    </main>
  );
}

function Link({ name, act }: { name: string; act: () => void }) {
  return (
    <p>
      <button type="button" className="btn" onClick={act}>
        {name}
      </button>
    </p>
  );
}
