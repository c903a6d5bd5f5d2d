const WIDTH = 304;
const GAP = 16;

export type Place = { left: number; top: number; side: "right" | "left" | "above" };

/** Where a step of the tour stands: beside what it is about, where there is room. */
export function placeOf(box: Pick<DOMRect, "left" | "right" | "top" | "width">, height: number, wide: number, tall: number): Place {
  const top = Math.max(52, Math.min(box.top - 8, tall - height - 32));
  if (box.right + GAP + WIDTH < wide) return { left: box.right + GAP, top, side: "right" };
  if (box.left - GAP - WIDTH > 48) return { left: box.left - GAP - WIDTH, top, side: "left" };
  return { left: Math.max(52, box.left + Math.min(box.width / 2 - WIDTH / 2, 160)), top: box.top - height - GAP, side: "above" };
}
