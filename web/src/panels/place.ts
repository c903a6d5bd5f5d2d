const WIDTH = 304;
const GAP = 16;

type Box = Pick<DOMRect, "left" | "right" | "top" | "bottom">;

export type Place = { left: number; top: number; side: "right" | "left" | "below" | "above" };

/** Where a step of the tour stands: next to what it is about, where there is room, and where it hides least of the others. */
export function placeOf(box: Box, height: number, wide: number, tall: number, others: readonly Box[] = []): Place {
  const top = Math.max(52, Math.min(box.top - 8, tall - height - 32));
  const left = Math.max(52, Math.min((box.left + box.right) / 2 - WIDTH / 2, box.left + 160, wide - WIDTH - GAP));
  const places: Place[] = [];
  if (box.right + GAP + WIDTH < wide) places.push({ left: box.right + GAP, top, side: "right" });
  if (box.left - GAP - WIDTH > 48) places.push({ left: box.left - GAP - WIDTH, top, side: "left" });
  if (box.bottom + GAP + height < tall - 32) places.push({ left, top: box.bottom + GAP, side: "below" });
  if (places.length === 0 || box.top - height - GAP > 52) places.push({ left, top: box.top - height - GAP, side: "above" });
  const hides = (place: Place) => others.reduce((sum, one) => sum + hidden(one, place, height), 0);
  return places.reduce((best, one) => (hides(one) < hides(best) ? one : best));
}

/** How much of a box lies below a step. */
function hidden(box: Box, { left, top }: Place, height: number): number {
  const across = Math.min(box.right, left + WIDTH) - Math.max(box.left, left);
  const down = Math.min(box.bottom, top + height) - Math.max(box.top, top);
  return Math.max(0, across) * Math.max(0, down);
}
