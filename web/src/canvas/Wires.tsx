import { memo, useEffect, useRef, useState } from "react";
import { onPulse, PULSE_MS } from "../live/activity";
import type { LayoutLine, LayoutRecord } from "../protocol/types";
import { useWaits, type Full } from "../live/waits";
import { edgeKey, nodeOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { meets, middleOf, pointsDown, rounded, tipOf } from "./geometry";
import { type Strand, spread } from "./spreading";
import { useSight, useZoom } from "./useView";
import type { Spot } from "./wiring";

const keys = new WeakMap<LayoutLine, string[]>();

/** The keys of the edges of a line. */
export function keysOf(line: LayoutLine): string[] {
  const known = keys.get(line);
  if (known) return known;
  const made = line.edges.map((edge) => edgeKey(edge.source, edge.target));
  keys.set(line, made);
  return made;
}

const NONE: ReadonlySet<string> = new Set();

/** All lines of a level, exactly as the layout routes them: data below, activity above, its last way on top. */
export const Wires = memo(function Wires({ layout, moved, spots }: { layout: LayoutRecord; moved: ReadonlySet<string>; spots: ReadonlyMap<string, Spot> }) {
  const ways = useStudio((s) => s.activity.ways);
  const picked = useStudio((s) => s.insertAt ?? s.selectedEdge);
  const nodes = useStudio((s) => s.tables.nodes);
  const full = useWaits((s) => s.edges);
  const near = useZoom((s) => s.level === "near");
  const selection = useStudio((s) => (near ? s.selection : NONE));
  const [over, setOver] = useState<string | null>(null);
  const sight = useSight(layout);
  const isMoved = (line: LayoutLine) => moved.size > 0 && line.edges.some((e) => moved.has(nodeOf(e.source)) || moved.has(nodeOf(e.target)));
  const lines = layout.lines.filter((line) => (sight === null || meets(line.points, sight)) && !isMoved(line));
  const draw = (line: LayoutLine) => {
    const keys = keysOf(line);
    const off = line.edges.some((e) => nodes[nodeOf(e.source)]?.enabled === false || nodes[nodeOf(e.target)]?.enabled === false);
    const id = keys.join();
    const chosen = near && line.edges.some((e) => selection.has(nodeOf(e.source)) || selection.has(nodeOf(e.target)));
    const strands = line.edges.length > 1 && !line.tag && layout.view !== "activity" && (over === id || chosen) ? spread(line, spots) : NO_STRANDS;
    return (
      <Wire
        key={id}
        line={line}
        strands={strands}
        over={setOver}
        full={keys.map((key) => full[key]).find(Boolean)}
        hot={line.is_active && keys.some((key) => ways.has(key))}
        picked={picked !== null && keys.includes(picked)}
        off={off}
        plain={layout.view === "activity"}
      />
    );
  };
  const active = lines.filter((line) => line.is_active);
  const isHot = (line: LayoutLine) => keysOf(line).some((key) => ways.has(key));
  return (
    <svg width="10" height="10" role="presentation">
      <g className="layer-data">{lines.filter((line) => !line.is_active).map(draw)}</g>
      <g className="layer-act">{active.filter((line) => !isHot(line)).map(draw)}</g>
      <g className="layer-hot">{active.filter(isHot).map(draw)}</g>
      <Pulses layout={layout} />
      {lines.map((line) => line.says !== "" && line.says_at && <Words key={keysOf(line).join()} x={line.says_at[0]} y={line.says_at[1]} text={line.says} plain={layout.view === "activity"} />)}
    </svg>
  );
});

const NO_STRANDS: Strand[] = [];

interface WireProps {
  line: LayoutLine;
  /** The edges of a bundle one by one, while it is spread. */
  strands: Strand[];
  over: (id: string | null) => void;
  full: Full | undefined;
  hot: boolean;
  picked: boolean;
  off: boolean;
  plain: boolean;
}

const Wire = memo(function Wire({ line, strands, over, full, hot, picked, off, plain }: WireProps) {
  const path = rounded(line.points, plain ? 9 : 7);
  const ends = new Set(line.edges.flatMap((edge) => [nodeOf(edge.source), nodeOf(edge.target)]));
  const more = `${hot ? " hot" : ""}${picked ? " picked" : ""}${off ? " off" : ""}`;
  const isSpread = strands.length > 0;
  const bundle = line.edges.length > 1;
  const flow = plain ? `activity-data${line.kind === "signal" ? " dash" : ""}` : line.kind === "signal" ? (bundle ? "sigb" : "sig") : bundle ? "data bundle" : "data";
  const sync = line.kind === "data" ? " sync" : "";
  const joint = line.is_active ? `joint${hot ? " hot" : ""}` : "jointd";
  return (
    <g
      className={isSpread ? "wire-group spread" : "wire-group"}
      data-ends={[...ends].join(" ")}
      data-edges={keysOf(line).join("\n")}
      onPointerEnter={bundle ? () => over(keysOf(line).join()) : undefined}
      onPointerLeave={bundle ? () => over(null) : undefined}
    >
      <path className="wire halo" d={path} style={line.is_active ? { strokeWidth: 9 } : plain ? { strokeWidth: 4.5 } : undefined} />
      {line.is_active ? (
        <>
          <path className={`wire act${sync}${more}`} d={path} />
          <path className={`wire core${hot ? " hotc" : ""}`} d={path} />
          <path className={`tip${sync}${hot ? " hot" : ""}`} d={tipOf(line.points)} />
        </>
      ) : (
        <>
          <path className={`wire ${flow}${more}`} d={path} />
          {(plain || pointsDown(line.points)) && !bundle && !full && <path className={plain ? "tip sync" : "tip d"} d={tipOf(line.points)} />}
        </>
      )}
      {line.combs.map((comb) => (
        <path key={comb.join()} className={`wire thin ${line.kind === "signal" ? "sig" : "data"}`} d={rounded(comb, 0)} />
      ))}
      {line.dots.map((dot) => (
        <circle key={dot.join()} className={joint} cx={dot[0]} cy={dot[1]} r={line.is_active ? 4 : 3} />
      ))}
      {line.count_at && bundle && <Count at={line.count_at} count={line.edges.length} />}
      <path className="wire hit" d={path} style={isSpread ? { strokeWidth: 12 + 7 * strands.length } : undefined} />
      {strands.map((one) => (
        <g key={one.key} data-edges={one.key}>
          <path className="wire halo" d={rounded(one.points)} />
          <path className={`wire ${line.is_active ? `act${sync}` : line.kind === "signal" ? "sig" : "data"} strand`} d={rounded(one.points)} />
          <path className="wire hit" d={rounded(one.points)} />
        </g>
      ))}
      {full && <FullMark line={line} full={full} />}
    </g>
  );
});

/** Nobody takes what is on the edge: the tip is red, and how much is there stands on the line. */
function FullMark({ line, full: [tokens, places] }: { line: LayoutLine; full: Full }) {
  const [x, y] = middleOf(line.points);
  const says = `${tokens} of ${places}`;
  const wide = 12 + 6 * says.length;
  return (
    <g className="full-mark" aria-label={`full, ${says}`}>
      <path className="tip blocked" d={tipOf(line.points)} />
      <rect className="count-pill" x={x - wide / 2} y={y - 8} width={wide} height="16" rx="8" />
      <text className="wlabel" x={x} y={y + 4} textAnchor="middle">
        {says}
      </text>
    </g>
  );
}

function Count({ at, count }: { at: readonly [number, number]; count: number }) {
  return (
    <>
      <rect className="count-pill" x={at[0] - 9} y={at[1] - 8} width="18" height="16" rx="8" />
      <text className="wlabel" style={{ fontWeight: 600 }} x={at[0]} y={at[1] + 4} textAnchor="middle">
        {count}
      </text>
    </>
  );
}

function Words({ x, y, text, plain }: { x: number; y: number; text: string; plain: boolean }) {
  return (
    <text className={plain ? "wlabel plain" : "wlabel"} x={x} y={y}>
      {text}
    </text>
  );
}

/** A hand-over runs along its line before the ring appears at the end. */
function Pulses({ layout }: { layout: LayoutRecord }) {
  const group = useRef<SVGGElement>(null);
  useEffect(
    () =>
      onPulse((edges) => {
        for (const line of layout.lines) {
          if (!line.is_active || !keysOf(line).some((key) => edges.includes(key))) continue;
          const pulse = document.createElementNS("http://www.w3.org/2000/svg", "path");
          pulse.setAttribute("class", "wire pulse");
          pulse.setAttribute("d", rounded(line.points));
          pulse.setAttribute("pathLength", "100");
          pulse.setAttribute("stroke-dasharray", "14 200");
          group.current?.append(pulse);
          const run = pulse.animate([{ strokeDashoffset: 14 }, { strokeDashoffset: -100 }], { duration: PULSE_MS });
          run.onfinish = () => pulse.remove();
          run.oncancel = run.onfinish;
        }
      }),
    [layout],
  );
  return <g ref={group} />;
}
