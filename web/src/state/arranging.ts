import type { NodeBox } from "../protocol/types";
import { edit, newGesture } from "./actions";
import { aligned, type Alignment, distributed, type Spot } from "./aligning";
import { layoutKey, studio } from "./studio";

/** What is selected on this level, where it lies. */
export function selectedBoxes(): NodeBox[] {
  const state = studio();
  const layout = state.tables.layouts[layoutKey(state)];
  return layout?.view === "activity" ? [] : (layout?.nodes.filter((box) => state.selection.has(box.id)) ?? []);
}

function place(boxes: readonly NodeBox[], spots: readonly Spot[]): void {
  void edit(
    boxes.map((box, index) => ({ do: "Note", path: box.id, name: "position", value: [...spots[index]!] })),
    newGesture(),
  );
}

export function align(way: Alignment): void {
  const boxes = selectedBoxes();
  place(boxes, aligned(boxes, way));
}

export function distribute(axis: "x" | "y"): void {
  const boxes = selectedBoxes();
  place(boxes, distributed(boxes, axis));
}
