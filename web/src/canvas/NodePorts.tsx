import { useEffect, useRef } from "react";
import { paintValue } from "../live/values";
import type { LayoutRecord, NodeBox, PortSpot } from "../protocol/types";
import { elapsed } from "../state/looking";
import { layoutKey, studio, useStudio } from "../state/studio";
import { useZoom } from "./useView";

const SHAPES: Record<PortSpot["kind"], string> = {
  input: "sq",
  output: "sq",
  slot: "ci",
  event: "ci",
  parameter: "pa",
  timeout: "to",
};

interface Props {
  box: NodeBox;
  path: string;
  active: boolean;
  limit: number | null;
}

/** The ports of a node where the layout puts them: squares are synchronous, circles are not. */
export function NodePorts({ box, path, active, limit }: Props) {
  const near = useZoom((s) => s.level === "near");
  const tagged = useStudio((s) => (near ? taggedIn(s.tables.layouts[layoutKey(s)]) : NONE));
  /** How many ports share the tag of one: those of a comb have one tag for all. */
  const sharing = (port: PortSpot): number => {
    const own = tagged.get(`${path}.${port.name}`) ?? 0;
    if (own === 0 || port.says !== "" || !isSide(port)) return own;
    return Math.max(own, box.ports.filter((one) => one.x === port.x && one.says === "" && tagged.has(`${path}.${one.name}`)).length);
  };
  return (
    <>
      {box.ports.map((port) => (
        <Port key={`${port.kind}.${port.name}`} port={port} x={port.x - box.x} y={port.y - box.y} node={path} active={active} limit={limit} near={near} tagged={sharing(port)} room={roomOf(port, box)} />
      ))}
    </>
  );
}

/** Names at the sides have room below the row of bars only; the tooltip has the others. */
const BELOW_BARS = 58;

const isSide = (port: PortSpot): boolean => port.kind === "input" || port.kind === "output" || port.kind === "parameter";

interface PortProps {
  port: PortSpot;
  x: number;
  y: number;
  node: string;
  active: boolean;
  limit: number | null;
  near: boolean;
  tagged: number;
  room: number;
}

const WIDEST = 116;

/** How wide a value may be: to the next port of the same side. */
function roomOf(port: PortSpot, box: NodeBox): number {
  if (isSide(port)) return WIDEST;
  const right = box.ports.filter((one) => one.y === port.y && one.x > port.x).map((one) => one.x);
  return Math.min(WIDEST, Math.min(...right, box.x + box.width + 40) - port.x - 16);
}

function Port({ port, x, y, node, active, limit, near, tagged, room }: PortProps) {
  const path = `${node}.${port.name}`;
  const broken = useStudio((s) => path in s.tables.breakpoints);
  const shape = SHAPES[port.kind];
  const isTimeout = port.kind === "timeout";
  const title = isTimeout ? `time-out: hands the activity on after ${port.says}` : undefined;
  const named = port.says !== "" && (y >= BELOW_BARS || !isSide(port));
  return (
    <>
      {(named || (near && !isSide(port))) && <PortName port={port} x={x} y={y} says={port.says || port.name} />}
      {near && !isTimeout && <PortValue port={port} path={path} node={node} x={x} y={y} named={named} tagged={tagged} room={room} />}
      <i
        className={`port nodrag nopan ${shape}${isTimeout && active ? " on" : ""}${broken ? " broken" : ""}`}
        style={{ left: x, top: y }}
        data-port={path}
        data-kind={port.kind}
        title={title}
      >
        {isTimeout && active && limit !== null && <Spent node={node} limit={limit} />}
      </i>
    </>
  );
}

/** How much of the time that the node may be active is over: the clock fills. */
function Spent({ node, limit }: { node: string; limit: number }) {
  const face = useRef<HTMLElement>(null);
  useEffect(() => {
    const paint = () => {
      const state = studio();
      const since = state.activity.since[node];
      if (since === undefined || !face.current) return;
      const share = Math.min(1, Math.max(0, (elapsed(state.tables.studio.run, state.clockOffset) - since) / limit));
      face.current.style.setProperty("--spent", `${Math.round(share * 360)}deg`);
    };
    paint();
    const timer = setInterval(paint, 250);
    return () => clearInterval(timer);
  }, [node, limit]);
  return <b className="spent" ref={face} />;
}

interface ValueProps {
  port: PortSpot;
  path: string;
  node: string;
  x: number;
  y: number;
  /** Its name stands at it already. */
  named: boolean;
  /** How many ports its tag is for; 0 if it has none. */
  tagged: number;
  /** How wide it may be. */
  room: number;
}

/** Beside a port, close up: its name at the sides, and its last value; before there is one, its type. */
function PortValue({ port, path, node, x, y, named, tagged, room }: ValueProps) {
  const value = useRef<HTMLElement>(null);
  const type = useStudio((s) => s.tables.nodes[node]?.ports.find((one) => one.name === port.name && one.kind === port.kind)?.type ?? "");
  useEffect(() => {
    if (value.current) value.current.textContent = isSide(port) ? type : "";
    return paintValue(path, (text) => {
      if (text === null || !value.current) return;
      value.current.textContent = text;
      value.current.classList.add("known");
    });
  }, [path, port, type]);
  const name = isSide(port) && !named && tagged === 0 && <em>{port.name}</em>;
  const [left, top] = placeOf(port, x, y, tagged > 0);
  if (tagged > 1) return null; // the tag has their room
  return (
    <span className={`pv num ${port.kind}`} style={{ left, top, maxWidth: room }} title={type}>
      {name}
      <span ref={value} />
    </span>
  );
}

/** Above the line that begins or ends there, or above its tag; of slots and events right of it. */
function placeOf(port: PortSpot, x: number, y: number, tagged: boolean): [number, number] {
  switch (port.kind) {
    case "slot":
      return [x + 8, y - 12];
    case "event":
      return [x + 8, y + 4];
    case "output":
      return [x + 7, y - (tagged ? 8 : 1.5)];
    default:
      return [x - 7, y - (tagged ? 8 : 1.5)];
  }
}

const NONE: ReadonlyMap<string, number> = new Map();

let known: { layout: LayoutRecord | undefined; tagged: Map<string, number> } = { layout: undefined, tagged: new Map() };

/** The ports at which a line has a tag instead of another end, and how many ports that tag is for. */
function taggedIn(layout: LayoutRecord | undefined): ReadonlyMap<string, number> {
  if (known.layout !== layout) {
    const lines = layout?.lines.filter((line) => line.tag) ?? [];
    known = { layout, tagged: new Map(lines.flatMap((line) => line.edges.flatMap((edge) => [edge.source, edge.target].map((path): [string, number] => [path, line.edges.length])))) };
  }
  return known.tagged;
}

function PortName({ port, x, y, says }: { port: PortSpot; x: number; y: number; says: string }) {
  switch (port.kind) {
    case "slot":
      return (
        <span className="pn" style={{ left: x, top: y + 6 }}>
          {says}
        </span>
      );
    case "event":
      return (
        <span className="pn" style={{ left: x, top: y - 17 }}>
          {says}
        </span>
      );
    case "timeout":
      return (
        <span className="pn l" style={{ left: x + 11, top: y - 13 }}>
          {says}
        </span>
      );
    case "output":
      return (
        <span className="pn r" style={{ left: x - 10, top: y - 6 }}>
          {says}
        </span>
      );
    default:
      return (
        <span className="pn l" style={{ left: x + 12, top: y - 6 }}>
          {says}
        </span>
      );
  }
}
