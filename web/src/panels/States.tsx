import { rounded, tipOf } from "../canvas/geometry";
import type { LayoutLine, LayoutRecord, NodeBox } from "../protocol/types";
import { show } from "../state/actions";
import { activeInside } from "../state/looking";
import { change, useStudio } from "../state/studio";
import { useAnswer } from "../state/useAnswer";
import { Icon } from "../ui/Icon";
import { plural } from "../ui/words";

interface Claim {
  holds: boolean | null;
  steps: { text: string }[];
  why: string;
}

interface Region {
  nodes: string[];
  at_most_one: Claim;
  exactly_one: Claim;
  states: number;
  unproved: string;
}

/** See `hfg.studio.states`. */
interface Found {
  layout: LayoutRecord | null;
  regions: Region[];
  states: { undrawn: string };
}

/** What the graph is as a state machine: which nodes can be active, and what leads from one to the next. */
export function States() {
  const open = useStudio((s) => s.panel === "states");
  return open ? <Panel /> : null;
}

function Panel() {
  const found = useAnswer<Found>("states", {});
  return (
    <section className="states" aria-label="States">
      <h2>
        States <span className="spring" />
        <button type="button" className="btn small" aria-label="Close the states" onClick={() => change({ panel: null })}>
          <Icon name="close" />
        </button>
      </h2>
      {found === null && <p className="second">Looking at what can be active …</p>}
      {found?.layout && <Diagram layout={found.layout} />}
      {found?.states.undrawn && <p className="second">{found.states.undrawn}</p>}
      {found && !found.layout && !found.states.undrawn && <p className="second">No active edge leads to a node, so no node is ever active. Choose an edge and press A to make it active.</p>}
      {found && found.regions.length > 0 && (
        <ul className="claims" aria-label="What is proved">
          {found.regions.map((region) => (
            <Proved key={region.nodes.join()} region={region} />
          ))}
        </ul>
      )}
    </section>
  );
}

/** What is known of the nodes between which activity moves, with the way to what is wrong. */
function Proved({ region }: { region: Region }) {
  const { at_most_one, exactly_one } = region;
  const wrong = [at_most_one, exactly_one].find((one) => one.holds === false);
  const says =
    exactly_one.holds === true
      ? "Exactly one is active: proved"
      : at_most_one.holds === true
        ? "At most one is active: proved"
        : wrong
          ? "More than one may be active"
          : `Not proved: ${at_most_one.why || exactly_one.why || region.unproved}`;
  return (
    <li>
      <b className={wrong && wrong === at_most_one ? "bad" : undefined}>{says}</b> <span className="muted">of {plural(region.nodes.length, "node")}</span>
      {at_most_one.holds === false && (
        <ol>
          {at_most_one.steps.map((step, number) => (
            <li key={number}>{step.text}</li>
          ))}
        </ol>
      )}
      {region.unproved !== "" && <p className="second">{region.unproved}</p>}
    </li>
  );
}

const MARGIN = 12;

/** The diagram as the studio lays it out; what is active is orange, as in the graph. */
function Diagram({ layout }: { layout: LayoutRecord }) {
  const [x, y, width, height] = [-MARGIN, -MARGIN, layout.width + 2 * MARGIN, layout.height + 2 * MARGIN];
  return (
    <div className="diagram">
      <svg viewBox={`${x} ${y} ${width} ${height}`} style={{ maxWidth: width, minWidth: Math.min(width, width / 2) }} role="group" aria-label="State diagram">
        {layout.nodes.filter((box) => box.is_open).map((box) => (
          <StateBox key={box.id} box={box} />
        ))}
        {layout.lines.map((line) => (
          <Way key={line.edges.map((edge) => edge.label).join()} line={line} />
        ))}
        {layout.nodes.filter((box) => !box.is_open).map((box) => (
          <StateBox key={box.id} box={box} />
        ))}
      </svg>
    </div>
  );
}

function Way({ line }: { line: LayoutLine }) {
  const path = rounded(line.points, 9);
  return (
    <g>
      <path className="wire halo" d={path} style={{ strokeWidth: 9 }} />
      <path className="wire act" d={path} />
      <path className="wire core" d={path} />
      <path className="tip" d={tipOf(line.points)} />
      {line.says_at && (
        <text className="wlabel plain" x={line.says_at[0]} y={line.says_at[1]}>
          {line.says}
        </text>
      )}
      {line.tag && (
        <text className="wlabel" x={line.tag.x + 4} y={line.tag.y + 11}>
          {line.tag.text}
        </text>
      )}
    </g>
  );
}

/** A state, or the frame of a subgraph around states. A click selects the node in the graph. */
function StateBox({ box }: { box: NodeBox }) {
  const active = useStudio((s) => box.id in s.activity.since || activeInside(s.activity, box.id) !== null);
  const selected = useStudio((s) => s.selection.has(box.id));
  const classes = ["state", box.is_open && "around", active && "on", selected && "sel"].filter(Boolean).join(" ");
  const act = () => show(box.id);
  return (
    <g
      className={classes}
      data-state={box.id}
      role="button"
      tabIndex={0}
      aria-label={`${box.name}${active ? ", active" : ""}`}
      aria-pressed={selected}
      onClick={act}
      onKeyDown={(event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        event.stopPropagation();
        act();
      }}
    >
      <title>{box.id}</title>
      <rect x={box.x} y={box.y} width={box.width} height={box.height} rx={box.is_open ? 6 : 12} />
      <text x={box.is_open ? box.x + 10 : box.x + box.width / 2} y={box.is_open ? box.y + 16 : box.y + box.height / 2 + 4} textAnchor={box.is_open ? "start" : "middle"}>
        {shortened(box.name, box.width)}
      </text>
    </g>
  );
}

const LETTER = 7;

/** The whole name is in the title. */
function shortened(name: string, width: number): string {
  const most = Math.max(3, Math.floor((width - 16) / LETTER));
  return name.length <= most ? name : `${name.slice(0, most - 1)}…`;
}
