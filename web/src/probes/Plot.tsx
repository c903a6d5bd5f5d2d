import { useEffect, useRef } from "react";
import { socket } from "../state/link";
import { colour, onTheme } from "../ui/colours";

const WINDOW_S = 12;
const HEIGHT = 64;

interface Numbers {
  times: number[];
  values: number[];
  fresh?: boolean;
}

/** A number over the last seconds. */
export function Plot({ path }: { path: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    let times: number[] = [];
    let values: number[] = [];
    const paint = () => canvas.current && draw(canvas.current, times, values);
    const subscription = socket.subscribe("history", { path }, 15, (next) => {
      const more = next as Numbers;
      if (more.fresh) [times, values] = [[], []];
      times.push(...more.times);
      values.push(...more.values);
      const from = times.findIndex((time) => time >= (times.at(-1) ?? 0) - WINDOW_S);
      if (from > 256) [times, values] = [times.slice(from), values.slice(from)];
      paint();
    });
    const unlisten = onTheme(paint);
    return () => {
      subscription.end();
      unlisten();
    };
  }, [path]);
  return <canvas ref={canvas} width={592} height={HEIGHT * 2} style={{ height: HEIGHT }} role="img" aria-label={`${path} over time`} data-plot={path} />;
}

function draw(canvas: HTMLCanvasElement, times: number[], values: number[]): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const last = times.at(-1);
  if (last === undefined) return;
  const low = Math.min(0, ...values);
  const high = Math.max(low + 1e-9, ...values);
  const x = (time: number) => width - 12 - ((last - time) / WINDOW_S) * (width - 12);
  const y = (value: number) => height - 12 - ((value - low) / (high - low)) * (height - 36);
  context.strokeStyle = colour("line2");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(0, y(0));
  context.lineTo(width, y(0));
  context.stroke();
  context.strokeStyle = colour("ink");
  context.lineWidth = 3;
  context.beginPath();
  times.forEach((time, index) => {
    if (last - time > WINDOW_S) return;
    context.lineTo(x(time), y(values[index]!));
  });
  context.stroke();
  context.fillStyle = colour("edge");
  context.beginPath();
  context.arc(x(last), y(values.at(-1)!), 6, 0, 7);
  context.fill();
  context.fillStyle = colour("ink3");
  context.font = `22px ${colour("font")}`;
  context.fillText(String(+high.toPrecision(3)), 8, 24);
}
