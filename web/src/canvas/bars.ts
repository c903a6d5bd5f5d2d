import { BARS, type Measure } from "../protocol/frames";
import { colour } from "../ui/colours";

/** Silent firings take less than this; they are drawn as a stump. */
const SLOW_S = 0.0003;

/** The last durations of a node, as high as the largest of them; amber above three times the median. */
export function drawBars(canvas: HTMLCanvasElement, measure: Measure, bars = BARS): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  const { width, height } = canvas;
  const values = measure.bars.subarray(Math.max(0, measure.bars.length - bars));
  context.clearRect(0, 0, width, height);
  context.fillStyle = colour("line2");
  context.fillRect(0, height - 1, width, 1);
  if (values.length === 0) return;
  const largest = Math.max(...values, 1e-9);
  const middle = [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? 0;
  const step = width / bars;
  values.forEach((value, index) => {
    const tall = Math.max(2, (value / largest) * (height - 2));
    context.fillStyle = value > 3 * middle && value > SLOW_S ? colour("warn") : colour("edge-soft");
    context.fillRect((bars - values.length + index) * step + 0.5, height - tall, step - 2, tall);
  });
}
