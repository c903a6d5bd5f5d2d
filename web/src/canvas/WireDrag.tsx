import { ViewportPortal } from "@xyflow/react";
import type { Fit } from "../protocol/types";
import { isSource } from "../state/actions";
import { nameOf, nodeOf, portOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { type Judged, reasonOf } from "../state/targets";
import { Icon } from "../ui/Icon";
import { loose } from "./geometry";
import type { Spot } from "./wiring";

/** The line that is drawn by hand, and what would become of it. */
export function WireDrag({ spots }: { spots: Map<string, Spot> }) {
  const wire = useStudio((s) => s.wire);
  if (!wire) return null;
  const from = spots.get(wire.from);
  const over = wire.over === null ? undefined : spots.get(wire.over);
  const fit = wire.over === null ? undefined : wire.targets?.ports.get(wire.over);
  const start: [number, number] = from ? [from.x, from.y] : [wire.point.x, wire.point.y];
  const end: [number, number] = over ? [over.x, over.y] : [wire.point.x, wire.point.y];
  const upright = from?.kind === "event" || from?.kind === "slot" || from?.kind === "timeout";
  const [a, b] = isSource(wire.from) ? [start, end] : [end, start];
  const refused = fit?.fit === "refused";
  return (
    <>
      <ViewportPortal>
        <div className="above">
          <svg width="10" height="10">
            <path className={refused ? "drag-wire no" : "drag-wire"} d={loose(a, b, upright)} />
            <circle cx={end[0]} cy={end[1]} r="4" fill={refused ? "var(--bad)" : "var(--you)"} />
          </svg>
        </div>
      </ViewportPortal>
      <DragLine from={wire.from} targets={wire.targets} free={wire.over === null} />
      {fit && wire.over !== null && (
        <Reason port={wire.over} from={wire.from} fit={fit} screen={wire.screen} active={wire.active} />
      )}
    </>
  );
}

function DragLine({ from, targets, free }: { from: string; targets: Judged | null; free: boolean }) {
  const name = `${nameOf(nodeOf(from))}.${portOf(from)}`;
  if (!targets) {
    return (
      <div className="pop dragline">
        <b>{name}</b>
        <span className="muted">asking</span>
      </div>
    );
  }
  const { expects, takes, refused } = targets.counts;
  return (
    <div className="pop dragline" role="status">
      <b style={{ fontWeight: 600 }}>{name}</b>
      <span className="second">{targets.sends || targets.expects || "a signal"}</span>
      <span className="num" style={{ color: "var(--you)", fontWeight: 600 }}>
        {expects === 1 ? "1 port expects it" : `${expects} ports expect it`}
      </span>
      <span className="num muted">
        {takes} more take anything, {refused} refuse
      </span>
      {free && <span className="muted">drop on nothing to add a node</span>}
    </div>
  );
}

function Reason({ port, from, fit, screen, active }: { port: string; from: string; fit: Fit; screen: { x: number; y: number }; active: boolean }) {
  const name = `${nameOf(nodeOf(port))}.${portOf(port)}`;
  const offset = document.getElementById("canvas")?.getBoundingClientRect() ?? new DOMRect();
  const style = { left: Math.max(8, screen.x - offset.x - 24), top: screen.y - offset.y + 24 };
  if (fit.fit === "refused") {
    return (
      <div className="pop reason no" style={style} role="alert">
        <b>
          <Icon name="no" />
          {name} does not take this
        </b>
        <p>
          {fit.expected && fit.sent ? <Types from={from} fit={fit} /> : null}
          {reasonOf(fit, port)}. {sentence(fit.remedy)}
        </p>
        <p style={{ marginTop: 6, color: "var(--you)", fontWeight: 600 }}>Drop here to choose a node between them</p>
      </div>
    );
  }
  return (
    <div className="pop reason yes" style={style}>
      <b>
        <Icon name="ok" />
        {name} takes {fit.sent || fit.expected || "this"}
      </b>
      <p className="muted" style={{ marginTop: 6 }}>
        <kbd>Alt</kbd> {active ? "it becomes active" : "make it active"} &nbsp; <kbd>Esc</kbd> leave it
      </p>
    </div>
  );
}

/** What one end expects, and what the other sends. */
function Types({ from, fit }: { from: string; fit: Fit }) {
  const [it, other] = isSource(from) ? ["expects", "sends"] : ["sends", "expects"];
  return (
    <>
      It {it} <b>{it === "sends" ? fit.sent : fit.expected}</b>, {portOf(from)} {other} <b>{it === "sends" ? fit.expected : fit.sent}</b>:{" "}
    </>
  );
}

const sentence = (words: string): string => (words === "" ? "" : `${words[0]!.toUpperCase()}${words.slice(1)}.`);
