import { useEffect } from "react";
import type { LayoutRecord } from "../protocol/types";
import { edgeKey, endsOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { loose } from "./geometry";
import { forgetAsked, type Spot } from "./wiring";

/** A wire that was dropped is there at once, in grey; the studio then draws it, or says why not. */
export function AskedWires({ layout, spots }: { layout: LayoutRecord; spots: Map<string, Spot> }) {
  const asked = useStudio((s) => s.asked);
  useEffect(() => {
    const drawn = new Set(layout.lines.flatMap((line) => line.edges.map((edge) => edgeKey(edge.source, edge.target))));
    const done = asked.filter((key) => drawn.has(key));
    if (done.length > 0) forgetAsked(done);
  }, [layout, asked]);
  if (asked.length === 0) return null;
  return (
    <svg width="10" height="10" role="presentation">
      {asked.map((key) => {
        const [from, to] = endsOf(key).map((port) => spots.get(port));
        if (!from || !to) return null;
        const upright = from.kind === "event" || from.kind === "timeout";
        return <path key={key} className="drag-wire asked" data-asked={key} d={loose([from.x, from.y], [to.x, to.y], upright)} />;
      })}
    </svg>
  );
}
