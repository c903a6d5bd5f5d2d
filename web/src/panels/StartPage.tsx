import { useEffect, useState } from "react";
import { ask, openFile, question } from "../state/actions";
import { change, type Popover, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { plural } from "../ui/words";
import { STARTER_PICTURES } from "./pictures";

interface Starter {
  name: string;
  title: string;
  about: string;
  nodes: number;
  edges: number;
}

interface Start {
  folder: string;
  files: { name: string; kind: string; changed: number }[];
  runs: string[];
  starters: Starter[];
}

const MOST_CARDS = 12;
const KINDS: Record<string, string> = { yaml: "graph file", python: "code", recording: "recording" };
const NOTHING: Start = { folder: "", files: [], runs: [], starters: [] };

/** Opens a graph that the studio offers, and lets it run. */
async function begin(starter: string, then: Popover = null): Promise<void> {
  if ((await ask({ t: "open", starter })) === null) return;
  if ((await ask({ t: "start", stay: true })) !== null && then !== null) change({ popover: then });
}

/** Nothing is open: a graph that runs at once, what can be opened here, and an empty graph. */
export function StartPage() {
  const folder = useStudio((s) => s.tables.studio.file?.folder ?? "");
  const [start, setStart] = useState<Start>(NOTHING);
  useEffect(() => {
    question<Start>("start", {}).then(setStart, () => undefined);
  }, []);
  const files = [...start.files].sort((a, b) => b.changed - a.changed).slice(0, MOST_CARDS);
  const [first, ...others] = start.starters;
  return (
    <main className="start">
      <div className="in">
        <div className="start-top">
          <div>
            <h1>Open a graph, or see one run</h1>
            <p>
              Files come from <b>{start.folder || folder}</b>. Nothing leaves this machine.
            </p>
          </div>
          <span className="spring" />
          <button type="button" className="btn line" onClick={() => change({ popover: "open" })}>
            <Icon name="file" />
            Open a file <kbd>Ctrl O</kbd>
          </button>
          <button type="button" className="btn primary" onClick={() => change({ begun: true })}>
            <Icon name="plus" />
            New graph
          </button>
        </div>
        {first && <First starter={first} />}
        {others.length > 0 && <h2 className="start-head">Start from something small</h2>}
        <div className="cards">
          {others.map((one) => (
            <button type="button" className="card" key={one.name} onClick={() => void begin(one.name)}>
              <span className="pic">{STARTER_PICTURES[one.name]}</span>
              <span className="tx">
                <b>{one.title}</b>
                <p>{one.about}</p>
                <small>{plural(one.nodes, "node")}, runs at once</small>
              </span>
            </button>
          ))}
        </div>
        <h2 className="start-head">In this folder</h2>
        {files.length === 0 && <p className="second">No graph files yet. What you save appears here.</p>}
        <div className="cards">
          {files.map((one) => (
            <button type="button" className="card" key={one.name} onClick={() => void openFile(one.name)}>
              <span className="tx">
                <b>{one.name}</b>
                <p>{KINDS[one.kind] ?? one.kind}</p>
              </span>
            </button>
          ))}
        </div>
        <h2 className="start-head">Runs on this machine</h2>
        {start.runs.length === 0 ? (
          <p className="second">
            None. A graph that was started by <span className="mono">hfg run</span> appears here.
          </p>
        ) : (
          start.runs.map((name) => (
            <p key={name}>
              <b>{name}</b> <span className="second mono">hfg studio --attach {name}</span>
            </p>
          ))
        )}
      </div>
    </main>
  );
}

/** The graph to look at first, in one click; with the tour in another. */
function First({ starter }: { starter: Starter }) {
  return (
    <section className="card first-card" aria-label={starter.title}>
      <span className="pic">{STARTER_PICTURES[starter.name]}</span>
      <div className="tx">
        <p className="lead">Runs at once, no robot needed</p>
        <h2>{starter.title}</h2>
        <p className="about">{starter.about}</p>
        <small>
          {plural(starter.nodes, "node")}, {plural(starter.edges, "edge")}, real time
        </small>
        <span className="spring" />
        <div className="row">
          <button type="button" className="btn primary" autoFocus onClick={() => void begin(starter.name)}>
            <Icon name="play" />
            Run it
          </button>
          <button type="button" className="btn line" onClick={() => void begin(starter.name, "tour")}>
            Take the tour, 5 steps
          </button>
        </div>
      </div>
    </section>
  );
}
