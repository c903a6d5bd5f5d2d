import { memo, useState } from "react";
import type { LayoutRecord, LayoutTag } from "../protocol/types";
import { useStudio } from "../state/studio";

/** A port of the level itself is a tag at each place where it is used; hover lights up all of one name. */
export const Tags = memo(function Tags({ layout }: { layout: LayoutRecord }) {
  const level = useStudio((s) => s.level);
  const [lit, setLit] = useState<readonly string[]>([]);
  const tags = new Map<string, { tag: LayoutTag; dashed: boolean }>();
  for (const line of layout.lines) {
    if (line.tag) tags.set(`${line.tag.x},${line.tag.y},${line.tag.text}`, { tag: line.tag, dashed: line.kind === "signal" });
  }
  return (
    <>
      {[...tags].map(([key, { tag, dashed }]) => (
        <div
          key={key}
          className={`tagg${dashed ? " sg" : ""}${tag.ports.some((port) => lit.includes(port)) ? " lit" : ""}`}
          style={{ left: tag.x, top: tag.y, width: tag.width, height: tag.height }}
          data-port={tag.ports.length === 1 ? innerPort(level, tag.ports[0]!) : undefined}
          data-kind={tag.kind}
          title={tag.ports.length > 1 ? tag.ports.join(", ") : undefined}
          onPointerEnter={() => setLit(tag.ports)}
          onPointerLeave={() => setLit([])}
        >
          {tag.text}
        </div>
      ))}
    </>
  );
});

function innerPort(level: string, port: string): string {
  if (level === "") return port;
  return port.includes(".") ? port : `${level}.${port}.inner`;
}
