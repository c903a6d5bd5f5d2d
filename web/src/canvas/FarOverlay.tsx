import { useViewport } from "@xyflow/react";
import type { LayoutRecord, NodeBox } from "../protocol/types";
import { enter, show } from "../state/actions";
import { activeInside } from "../state/looking";
import { below } from "../state/paths";
import { useStudio } from "../state/studio";

/** From far away a node is a block. What is active has at least 16 × 10 px of the screen, and a label that leads there. */
export function FarOverlay({ layout }: { layout: LayoutRecord }) {
  const view = useViewport();
  const activity = useStudio((s) => s.activity);
  const place = (box: NodeBox) => ({
    left: box.x * view.zoom + view.x,
    top: box.y * view.zoom + view.y,
    width: box.width * view.zoom,
    height: box.height * view.zoom,
  });
  return (
    <>
      {layout.nodes.map((box) => {
        const inside = activeInside(activity, box.id);
        const active = box.id in activity.since || inside !== null;
        const at = place(box);
        if (!active) return box.kind === "subgraph" && at.width > 40 ? <FarName key={box.id} box={box} at={at} /> : null;
        const width = Math.max(16, at.width);
        const height = Math.max(10, at.height);
        const left = at.left - (width - at.width) / 2;
        const top = at.top - (height - at.height) / 2;
        return (
          <div key={box.id}>
            <div className="far-active" style={{ left, top, width, height }} />
            <button
              type="button"
              className="far-label"
              style={{ left: left + width + 8, top: top + height / 2 - 10 }}
              onClick={() => (inside ? show(inside) : enter(box.id))}
            >
              {inside ? `${box.name} › ${below(inside, box.id)}` : box.name}
            </button>
          </div>
        );
      })}
    </>
  );
}

function FarName({ box, at }: { box: NodeBox; at: { left: number; top: number } }) {
  return (
    <span className="far-name" style={{ left: at.left, top: at.top - 13 }}>
      {box.name}
    </span>
  );
}
