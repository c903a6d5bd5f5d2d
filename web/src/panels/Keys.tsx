import { DOINGS } from "../keys/commands";
import { change } from "../state/studio";

const MORE: [string, string][] = [
  ["Arrows", "go along edges to the next node"],
  ["Shift Arrows", "move the selection by 8"],
  ["Ctrl click", "add to the selection"],
  ["Shift drag", "select what is in the frame"],
  ["Wheel", "zoom at the mouse"],
  ["F6", "from region to region"],
  ["Double click", "palette; into a subgraph; rename"],
];

export function Keys() {
  const close = () => change({ popover: null });
  return (
    <div className="veil" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop keys grows" role="dialog" aria-label="Keys">
        <div className="row" style={{ marginBottom: 8 }}>
          <h2 style={{ font: "600 15px/20px var(--font)" }}>Keys</h2>
          <span className="spring" />
          <button type="button" className="btn line" onClick={() => change({ popover: "tour" })}>
            Take the tour, 5 steps
          </button>
          <button type="button" className="btn" autoFocus onClick={close}>
            Close
          </button>
        </div>
        <dl>
          {[...DOINGS.filter((one) => one.keys !== "").map((one) => [one.keys.replaceAll("+", " "), one.name]), ...MORE].map(([keys, name]) => (
            <div key={keys}>
              <dt>
                <kbd>{keys}</kbd>
              </dt>
              <dd>{name}</dd>
            </div>
          ))}
        </dl>
      </div>
    </div>
  );
}
