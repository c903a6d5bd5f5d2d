import { useViewport } from "@xyflow/react";
import type { LayoutRecord, NodeBox } from "../protocol/types";
import { enter, show } from "../state/actions";
import { activeInside, groupClass } from "../state/looking";
import { below, isInside } from "../state/paths";
import { useStudio } from "../state/studio";
import { counted, plural } from "../ui/words";

interface At {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** From far away a node is a block. What is active has at least 16 × 10 px of the screen, and a label that leads there. */
export function FarOverlay({ layout }: { layout: LayoutRecord }) {
  const view = useViewport();
  const activity = useStudio((s) => s.activity);
  const level = useStudio((s) => s.level);
  const place = (box: NodeBox): At => ({
    left: box.x * view.zoom + view.x,
    top: box.y * view.zoom + view.y,
    width: box.width * view.zoom,
    height: box.height * view.zoom,
  });
  return (
    <>
      {layout.nodes.map((box) => {
        const at = place(box);
        const inside = activeInside(activity, box.id);
        const active = box.id in activity.since || inside !== null;
        if (box.is_open || !active) {
          const roomy = box.is_open && headroom(box, layout) * view.zoom >= NAME_HEIGHT + 4;
          return box.kind === "subgraph" && <FarFrame key={box.id} box={box} at={at} active={active} roomy={roomy} />;
        }
        return <FarActive key={box.id} at={at} says={words(inside ?? box.id, level)} go={() => (inside ? show(inside) : layout.deep ? show(box.id) : enter(box.id))} />;
      })}
      <FarLegend layout={layout} />
    </>
  );
}

/** The last two names on the way there: "visit › position". */
const words = (path: string, level: string): string => below(path, level).split(" › ").slice(-2).join(" › ");

function FarActive({ at, says, go }: { at: At; says: string; go: () => void }) {
  const width = Math.max(16, at.width);
  const height = Math.max(10, at.height);
  const left = at.left - (width - at.width) / 2;
  const top = at.top - (height - at.height) / 2;
  return (
    <div>
      <div className="far-active" style={{ left, top, width, height }} />
      <button type="button" className="far-label" style={{ left: left + width + 8, top: top + height / 2 - 10 }} onClick={go}>
        {says}
      </button>
    </div>
  );
}

const NAME_HEIGHT = 13;

/** How much is free between the upper edge of an open subgraph and the nodes in it. */
const headroom = (box: NodeBox, layout: LayoutRecord): number =>
  Math.min(...layout.nodes.filter((one) => isInside(one.id, box.id)).map((one) => one.y)) - box.y;

/** A subgraph: its name if there is room, and its outline if one sees what is in it. */
function FarFrame({ box, at, active, roomy }: { box: NodeBox; at: At; active: boolean; roomy: boolean }) {
  return (
    <>
      {box.is_open && <div className={active ? "far-frame on" : "far-frame"} style={at} />}
      {at.width > 40 && (
        <span className={active ? "far-name on" : "far-name"} style={{ left: at.left + (roomy ? 4 : 0), top: at.top + (roomy ? 2 : -NAME_HEIGHT), maxWidth: at.width }}>
          {box.name}
        </span>
      )}
    </>
  );
}

/** What the colours of the blocks mean. */
function FarLegend({ layout }: { layout: LayoutRecord }) {
  const tables = useStudio((s) => s.tables);
  const since = useStudio((s) => s.activity.since);
  const active = layout.nodes.filter((box) => !box.is_open && Object.keys(since).some((path) => path === box.id || isInside(path, box.id))).length;
  const groups = Object.keys(tables.groups).filter((name) => layout.nodes.some((box) => (tables.nodes[box.id]?.group ?? box.group) === name));
  const nodes = layout.nodes.filter((box) => !box.is_open).length;
  return (
    <div className="legend">
      <span>
        <i style={{ background: "var(--on)" }} />
        active
      </span>
      {groups.map((name) => (
        <span key={name}>
          <i className={`swatch ${groupClass(tables, name)}`} style={{ margin: 0, width: 12, height: 12 }} />
          {name}
        </span>
      ))}
      <span className="muted num">
        {plural(nodes, "node")}, {counted(active)} active
      </span>
    </div>
  );
}
