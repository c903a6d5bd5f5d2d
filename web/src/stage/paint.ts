import type { Point, Scene, Shape } from "../protocol/types";
import { colour } from "../ui/colours";

/** A scene names colours by what they are for; each theme has its own. */
const TOKENS: Record<string, string> = {
  ink: "ink",
  soft: "ink3",
  faint: "data",
  line: "line2",
  ground: "canvas",
  raised: "surface",
  good: "ok",
  bad: "bad",
  warn: "warn",
  one: "g1",
  two: "g2",
  three: "g3",
  four: "loop",
};

const LEAST_TEXT = 10;

type Context = CanvasRenderingContext2D;

const tint = (name: string): string => colour(TOKENS[name] ?? "ink");

/** How a scene lies on a drawing of a width, in pixels: its height, and where a point of its world is. */
export function placed(bounds: Scene["bounds"], width: number) {
  const [left, bottom, right, top] = bounds;
  const scale = width / (right - left || 1);
  const height = Math.abs(top - bottom) * scale;
  return { scale, height, at: ([x, y]: Point): Point => [(x - left) * scale, (top < bottom ? y - top : top - y) * scale] };
}

/** Paints a scene; its images in order, as far as they are there. */
export function paint(context: Context, scene: Scene, width: number, images: readonly (ImageBitmap | null)[]): void {
  const { scale, height, at } = placed(scene.bounds, width);
  context.clearRect(0, 0, width, height);
  context.lineJoin = context.lineCap = "round";
  let image = 0;
  for (const shape of scene.shapes) one(context, shape, scale, at, shape[0] === "image" ? (images[image++] ?? null) : null);
}

function one(context: Context, shape: Shape, scale: number, at: (point: Point) => Point, image: ImageBitmap | null): void {
  switch (shape[0]) {
    case "line":
    case "area": {
      const [kind, points, fill, line, width] = shape;
      context.beginPath();
      for (const point of points) context.lineTo(...at(point));
      if (kind === "area") context.closePath();
      finish(context, fill, line, width);
      break;
    }
    case "disc": {
      const [, middle, radius, fill, line, width] = shape;
      context.beginPath();
      context.arc(...at(middle), radius * scale, 0, 7);
      finish(context, fill, line, width);
      break;
    }
    case "rays":
      rays(context, at(shape[1]), shape[2].map(at), tint(shape[3]));
      break;
    case "text": {
      const [, text, place, size, name, anchor] = shape;
      context.font = `600 ${Math.max(LEAST_TEXT, size * scale)}px ${colour("font")}`;
      context.textAlign = anchor === "middle" ? "center" : anchor;
      context.textBaseline = "middle";
      context.strokeStyle = colour("surface"); // whatever lies below, an image for one, it can be read
      context.lineWidth = 3;
      context.strokeText(text, ...at(place));
      context.fillStyle = tint(name);
      context.fillText(text, ...at(place));
      break;
    }
    case "image": {
      const [left, bottom, right, top] = shape[2];
      const [[x0, y0], [x1, y1]] = [at([left, top]), at([right, bottom])];
      if (image) context.drawImage(image, x0, y0, x1 - x0, y1 - y0);
    }
  }
}

function finish(context: Context, fill: string, line: string, width: number): void {
  if (fill !== "") {
    context.fillStyle = tint(fill);
    context.fill();
  }
  if (line !== "") {
    context.strokeStyle = tint(line);
    context.lineWidth = width;
    context.stroke();
  }
}

function rays(context: Context, begin: Point, ends: Point[], tone: string): void {
  context.strokeStyle = context.fillStyle = tone;
  context.lineWidth = 1;
  context.globalAlpha = 0.22;
  context.beginPath();
  for (const end of ends) {
    context.moveTo(...begin);
    context.lineTo(...end);
  }
  context.stroke();
  context.globalAlpha = 1;
  for (const [x, y] of ends) context.fillRect(x - 1, y - 1, 2, 2);
}
