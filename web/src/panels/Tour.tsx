import { useState } from "react";
import { change } from "../state/studio";

interface Step {
  at: string;
  title: string;
  text: string;
}

const STEPS: Step[] = [
  { at: ".node", title: "A node does one thing", text: "Inputs are on its left, outputs on its right. It fires when all inputs have a value; the bars show how long the last firings took." },
  {
    at: ".node.active, .node",
    title: "The orange outline is the state",
    text: "There is no state machine. Whoever has the activity is the state, and gives it on over a double line. Double click a subgraph to see what goes on inside.",
  },
  { at: "#canvas .port", title: "Draw a line from a port", text: "Ports that take it light up, all others say why not. Drop it on nothing to choose a node that fits." },
  { at: "#side", title: "Change it while it runs", text: "Every parameter takes effect at once, and everything can be undone. Click a port to pin what it sends." },
  { at: "#time", title: "When, and for how long", text: "Activity above, firings of each group below. What you choose here is chosen in the graph." },
];

export function Tour() {
  const [index, setIndex] = useState(0);
  const step = STEPS[index]!;
  const box = document.querySelector(step.at)?.getBoundingClientRect() ?? new DOMRect(200, 200, 100, 40);
  const right = box.right + 320 < window.innerWidth;
  const left = right ? box.right + 16 : Math.max(60, Math.min(box.left, window.innerWidth) - 324);
  const top = Math.max(56, Math.min(box.top - 8, window.innerHeight - 220));
  const leave = () => change({ popover: null });
  return (
    <div className={`pop coach grows${right ? "" : " from-right"}`} style={{ left, top, position: "fixed" }} role="dialog" aria-label={step.title}>
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

