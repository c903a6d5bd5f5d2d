/** What moves by itself stands still for a moment when somebody presses something: the next frame is for the answer. */
const MOMENT_MS = 100;
let until = 0;

for (const type of ["pointerdown", "keydown", "dblclick"]) {
  window.addEventListener(type, (event) => (until = event.timeStamp + MOMENT_MS), { capture: true, passive: true });
}

/** Whether that moment lasts; what was painted long ago, in milliseconds of the page, is painted anyway. */
export function givesWay(painted: number): boolean {
  const now = performance.now();
  return now < until && now - painted < 2 * MOMENT_MS;
}
