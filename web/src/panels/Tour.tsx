import { useEffect, useLayoutEffect, useRef, useState } from "react";
import { select } from "../state/actions";
import { change, studio } from "../state/studio";
import { type Place, placeOf } from "./place";

interface Step {
  title: string;
  text: string;
  /** What it is about; looked for again and again, because activity moves. */
  at: () => Element | null | undefined;
  before?: () => void;
}

const nodeElement = (path: string) => document.querySelector(`#canvas [data-node="${CSS.escape(path)}"]`);

/** A node of this level that computes something, if there is one: with an input, an output and a parameter. */
function worker(): string {
  const { tables, level } = studio();
  const nodes = Object.values(tables.nodes).filter((one) => one.level === level && !one.subgraph);
  const has = (kind: string) => (one: (typeof nodes)[number]) => one.ports.some((port) => port.kind === kind);
  const found = nodes.find((one) => has("input")(one) && has("output")(one) && one.shown.length > 0) ?? nodes.find((one) => one.shown.length > 0);
  return (found ?? nodes[0])?.path ?? "";
}

const STEPS: Step[] = [
  {
    at: () => nodeElement(worker()),
    title: "A node does one thing",
    text: "Inputs are on its left, outputs on its right. It fires when all inputs have a value. The bars show how long the last firings took.",
  },
  {
    at: () => document.querySelector("#canvas .node.active") ?? document.querySelector("#canvas .node"),
    title: "The orange outline is the state",
    text: "There is no state machine. The node that has the activity is the state, and hands it on over a double line. Double click a subgraph to see what goes on inside.",
  },
  {
    at: () => nodeElement(worker()),
    title: "Draw a line from a port",
    text: "Press on one of its squares or circles, and drag. Ports that take it light up, all others say why not. Drop it on nothing to choose a node that fits.",
  },
  {
    before: () => {
      change({ side: true });
      select([worker()].filter((path) => path !== ""));
    },
    at: () => document.querySelector("#side"),
    title: "Change it while it runs",
    text: "Every parameter takes effect at once, and everything can be undone. Click a port to pin what it sends.",
  },
  {
    before: () => change({ time: true, tab: "timeline" }),
    at: () => document.querySelector("#time"),
    title: "When, and for how long",
    text: "Activity above, firings of each group below. What you choose here is chosen in the graph.",
  },
];

const LOOK_EVERY_MS = 200;

export function Tour() {
  const [index, setIndex] = useState(0);
  const [place, setPlace] = useState<Place>({ left: 200, top: 200, side: "right" });
  const root = useRef<HTMLDivElement>(null);
  const step = STEPS[index]!;
  useEffect(() => step.before?.(), [step]);
  useLayoutEffect(() => {
    const look = () => {
      const about = step.at();
      if (!about) return;
      const others = [...document.querySelectorAll("#canvas .node")].filter((one) => one !== about).map((one) => one.getBoundingClientRect());
      setPlace(placeOf(about.getBoundingClientRect(), root.current?.offsetHeight ?? 160, window.innerWidth, window.innerHeight, others));
    };
    look();
    const timer = setInterval(look, LOOK_EVERY_MS);
    return () => clearInterval(timer);
  }, [step]);
  const leave = () => change({ popover: null });
  return (
    <div className={`pop coach at-${place.side}`} ref={root} style={{ left: place.left, top: place.top, position: "fixed" }} role="dialog" aria-label={step.title}>
      <h4>{step.title}</h4>
      <p>{step.text}</p>
      <div className="row">
        <span className="dots" aria-label={`Step ${index + 1} of ${STEPS.length}`} role="img">
          {STEPS.map((one, at) => (
            <i key={one.title} className={at === index ? "a" : ""} />
          ))}
        </span>
        <span className="spring" />
        <button type="button" className="btn" onClick={leave}>
          Leave
        </button>
        <button type="button" className="btn primary" autoFocus onClick={() => (index + 1 < STEPS.length ? setIndex(index + 1) : leave())}>
          {index + 1 < STEPS.length ? "Next" : "Done"}
        </button>
      </div>
    </div>
  );
}
