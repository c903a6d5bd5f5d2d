import { useReactFlow } from "@xyflow/react";
import { type PointerEvent, useState } from "react";
import type { AnnotationRecord, LayoutRecord, NodeBox } from "../protocol/types";
import { annotate, keyOf, pickAnnotation } from "../state/annotating";
import { locked, select } from "../state/actions";
import { change, useStudio } from "../state/studio";

/** Frames lie under everything else, notes above; both move with what they are about. */
export function Annotations({ layout, kind, moved }: { layout: LayoutRecord; kind: AnnotationRecord["kind"]; moved: ReadonlyMap<string, { x: number; y: number }> }) {
  const level = useStudio((s) => s.level);
  const all = useStudio((s) => s.tables.annotations);
  if (layout.view === "activity") return null;
  const here = Object.values(all).filter((one) => one.level === level && one.kind === kind);
  return <>{here.map((one) => (kind === "frame" ? <Frame key={one.name} frame={one} layout={layout} moved={moved} /> : <Note key={one.name} note={one} />))}</>;
}

const ROOM = 20;
const HEAD = 28;

function Frame({ frame, layout, moved }: { frame: AnnotationRecord; layout: LayoutRecord; moved: ReadonlyMap<string, { x: number; y: number }> }) {
  const picked = useStudio((s) => s.annotation === keyOf(frame));
  const boxes = layout.nodes.filter((box) => frame.members.includes(box.id)).map((box) => ({ ...box, ...moved.get(box.id) }));
  if (boxes.length === 0) return null;
  const [left, top, right, bottom] = around(boxes);
  return (
    <div className={picked ? "frame-box picked" : "frame-box"} style={{ left: left - ROOM, top: top - ROOM - HEAD, width: right - left + 2 * ROOM, height: bottom - top + 2 * ROOM + HEAD }}>
      <div
        className="frame-head nodrag nopan"
        data-annotation={keyOf(frame)}
        onClick={() => {
          select(boxes.map((box) => box.id));
          pickAnnotation(keyOf(frame));
        }}
      >
        <Text of={frame} empty="Name this frame" />
      </div>
    </div>
  );
}

function around(boxes: NodeBox[]): [number, number, number, number] {
  return [
    Math.min(...boxes.map((box) => box.x)),
    Math.min(...boxes.map((box) => box.y)),
    Math.max(...boxes.map((box) => box.x + box.width)),
    Math.max(...boxes.map((box) => box.y + box.height)),
  ];
}

const BEGINS_PX = 4;

/** Where a note is while it is dragged, and how large; the studio has it once it is let go. */
function Note({ note }: { note: AnnotationRecord }) {
  const flow = useReactFlow();
  const picked = useStudio((s) => s.annotation === keyOf(note));
  const [hand, setHand] = useState<{ by: "at" | "size"; from: [number, number]; dx: number; dy: number } | null>(null);
  const place = (by: "at" | "size"): [number, number] => {
    const [x, y] = note[by];
    if (hand?.by !== by) return [x, y];
    const least = by === "size" ? [80, 32] : [Number.NEGATIVE_INFINITY, Number.NEGATIVE_INFINITY];
    return [Math.max(least[0]!, Math.round((x + hand.dx) / 8) * 8), Math.max(least[1]!, Math.round((y + hand.dy) / 8) * 8)];
  };
  const down = (by: "at" | "size") => (event: PointerEvent<HTMLElement>) => {
    if (event.button !== 0 || event.target instanceof HTMLTextAreaElement) return;
    event.stopPropagation();
    select([]);
    pickAnnotation(keyOf(note));
    if (locked() !== "") return;
    event.currentTarget.setPointerCapture(event.pointerId);
    setHand({ by, from: [event.clientX, event.clientY], dx: 0, dy: 0 });
  };
  const move = (event: PointerEvent<HTMLElement>) => {
    if (!hand) return;
    const [dx, dy] = [event.clientX - hand.from[0], event.clientY - hand.from[1]];
    if (hand.dx === 0 && hand.dy === 0 && Math.hypot(dx, dy) < BEGINS_PX) return;
    setHand({ ...hand, dx: dx / flow.getZoom(), dy: dy / flow.getZoom() });
  };
  const up = () => {
    if (!hand) return;
    const next = place(hand.by);
    const stays = () => setHand(null);
    if (hand.dx === 0 && hand.dy === 0) stays();
    else void annotate({ kind: "note", level: note.level, name: note.name, [hand.by]: next }).then(stays, stays);
  };
  const [x, y] = place("at");
  const [width, height] = place("size");
  return (
    <div
      className={picked ? "note nodrag nopan picked" : "note nodrag nopan"}
      data-annotation={keyOf(note)}
      style={{ left: x, top: y, width, minHeight: height }}
      onPointerDown={down("at")}
      onPointerMove={move}
      onPointerUp={up}
    >
      <Text of={note} empty="Write a note" />
      <i className="grip" title="Size of the note" onPointerDown={down("size")} onPointerMove={move} onPointerUp={up} />
    </div>
  );
}

/** The text, or the field to write it; what is written is kept when one leaves the field. */
function Text({ of, empty }: { of: AnnotationRecord; empty: string }) {
  const writing = useStudio((s) => s.writing === keyOf(of));
  if (!writing) {
    return (
      <span className={of.text === "" ? "muted" : ""} onDoubleClick={() => locked() === "" && change({ writing: keyOf(of) })}>
        {of.text || empty}
      </span>
    );
  }
  const keep = (text: string) => {
    change({ writing: null });
    if (text !== of.text) void annotate({ kind: of.kind, level: of.level, name: of.name, text });
  };
  return (
    <textarea
      autoFocus
      aria-label={of.kind === "note" ? "Text of the note" : "Name of the frame"}
      defaultValue={of.text}
      rows={of.kind === "note" ? 4 : 1}
      onFocus={(event) => event.target.select()}
      onBlur={(event) => keep(event.target.value.trim())}
      onPointerDown={(event) => event.stopPropagation()}
      onKeyDown={(event) => {
        event.stopPropagation();
        if (event.key === "Escape" || (event.key === "Enter" && !event.shiftKey)) event.currentTarget.blur();
      }}
    />
  );
}
