import { useLoad } from "../live/load";
import { groupClass } from "../state/looking";
import { nameOf } from "../state/paths";
import { studio } from "../state/studio";
import { colour } from "../ui/colours";
import { percent } from "../ui/words";
import { icicle, type Lane, lanesOf, type Piece, steps, tickStep } from "./icicle";
import { type Box, record, useWindow } from "./store";

export const GUTTER = 136;
const RIGHT = 12;
const ROW = 17;
const LANE = 19;
const TOP = 42;
const SLOWEST_S = 0.006;
/** A ring around less hides it. */
const RING_PX = 6;

interface Target {
  x: number;
  y: number;
  width: number;
  height: number;
  path: string;
}

/** What can be clicked, in the places where it was drawn last. */
export let targets: Target[] = [];
export let scale = { begin: 0, length: 1, width: 1 };

export const timeAt = (x: number): number => scale.begin + ((x - GUTTER) / (scale.width - GUTTER - RIGHT)) * scale.length;
export const overviewTimeAt = (x: number): number => ((x - GUTTER) / (scale.width - GUTTER - RIGHT)) * record.now;

let drawn = "";

/** What the picture depends on: it is drawn again only when that has changed. */
function stateOf(canvas: HTMLCanvasElement): string {
  const { follows, length, end } = useWindow.getState();
  const { selection, theme, activity } = studio();
  const about = [canvas.clientWidth, canvas.clientHeight, window.devicePixelRatio, follows, length, end, theme, record.turn];
  return `${about.join()} ${[...selection].join()} ${Object.keys(activity.since).length}`;
}

export function drawTimeline(canvas: HTMLCanvasElement, again = false): void {
  const context = canvas.getContext("2d");
  const state = stateOf(canvas);
  if (!context || (!again && state === drawn)) return;
  drawn = state;
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const { follows, length, end } = useWindow.getState();
  const right = follows && record.cursor === null ? Math.max(record.now, length) : end;
  scale = { begin: right - length, length, width };
  targets = [];
  new Drawing(context, width, height).all();
}

class Drawing {
  private readonly selection = studio().selection;

  constructor(
    private readonly c: CanvasRenderingContext2D,
    private readonly width: number,
    private readonly height: number,
  ) {}

  all(): void {
    this.c.fillStyle = colour("surface");
    this.c.fillRect(0, 0, this.width, this.height);
    this.c.textBaseline = "middle";
    const lanes = lanesOf(record.spans, record.now);
    this.overview(lanes);
    this.axis();
    const below = this.activity(lanes);
    if (this.height > 110) this.groups(below + 4);
    this.playhead();
  }

  private x(time: number): number {
    return GUTTER + ((time - scale.begin) / scale.length) * (this.width - GUTTER - RIGHT);
  }

  private text(words: string, x: number, y: number, token: string, weight = 450, size = 11): void {
    this.c.font = `${weight} ${size}px ${colour("font")}`;
    this.c.fillStyle = colour(token);
    this.c.fillText(words, x, y);
  }

  private fits(words: string, width: number): boolean {
    return this.c.measureText(words).width + 8 < width;
  }

  private overview(lanes: Lane[]): void {
    this.text("whole run", 12, 14, "ink3");
    const whole = Math.max(record.now, 1e-6);
    const room = this.width - GUTTER - RIGHT;
    const at = (time: number) => GUTTER + (Math.min(time, whole) / whole) * room;
    this.c.fillStyle = colour("surface2");
    this.c.fillRect(GUTTER, 6, room, 16);
    const height = 16 / Math.max(1, lanes.length);
    lanes.forEach(({ spans, prefix }, index) => {
      const y = 6 + index * height;
      for (const step of steps(spans, record.now, record.cursor)) {
        const left = at(step.begin);
        const wide = Math.max(1.5, at(step.end) - left);
        this.c.fillStyle = colour(step.now ? "on" : "line2");
        this.c.fillRect(left, y, Math.max(1, wide - 1), lanes.length > 1 ? height - 1 : height);
        this.c.font = `500 11px ${colour("font")}`;
        if (lanes.length === 1 && this.fits(step.name, wide)) this.text(step.name, left + 4, 14.5, step.now ? "on-text" : "ink", 500);
        targets.push({ x: left, y, width: wide, height, path: full(prefix, step.path) });
      }
    });
    this.c.strokeStyle = colour("you");
    this.c.lineWidth = 2;
    const left = at(Math.max(0, scale.begin));
    this.c.strokeRect(left, 4, Math.max(2, at(scale.begin + scale.length) - left), 20);
    this.c.lineWidth = 1;
    if (record.cursor !== null) {
      this.c.fillStyle = colour("you");
      this.c.fillRect(at(record.cursor) - 1, 3, 2, 22);
    }
  }

  private axis(): void {
    const step = tickStep(scale.length);
    const places = step < 0.1 ? 2 : step < 1 ? 1 : 0;
    for (let index = Math.ceil(scale.begin / step); index * step <= scale.begin + scale.length; index++) {
      const x = Math.round(this.x(index * step));
      this.c.fillStyle = colour("line");
      this.c.fillRect(x, TOP, 1, this.height - TOP);
      if (index % 2 === 0 && index >= 0 && x < this.width - 40) this.text(`${(index * step).toFixed(places)} s`, x + 4, 34, "ink3");
    }
  }

  /** Three rows for what follows each other; fewer for each of what goes on at the same time, or where there is no room. */
  private activity(lanes: Lane[]): number {
    const room = Math.floor((this.height - TOP) / ROW / Math.max(1, lanes.length));
    const rows = Math.max(1, Math.min(room, lanes.length < 2 ? 3 : lanes.length === 2 ? 2 : 1));
    lanes.forEach(({ spans, prefix }, lane) => {
      const top = TOP + lane * rows * ROW;
      this.text(lanes.length > 1 && prefix !== "" ? nameOf(prefix) : "activity", 12, top + 9, "ink2", 600);
      icicle(spans, scale.begin, record.now, rows, record.cursor).forEach((pieces, row) => {
        for (const piece of pieces) this.piece(piece, top + row * ROW, full(prefix, piece.path));
      });
    });
    return TOP + Math.max(1, lanes.length) * rows * ROW;
  }

  private piece(piece: Piece, y: number, path: string): void {
    const left = Math.max(GUTTER, this.x(piece.begin));
    const right = Math.min(this.width - RIGHT, this.x(piece.end));
    if (right < GUTTER || left > this.width - RIGHT) return;
    const wide = Math.max(2, right - left - 1);
    this.c.fillStyle = colour(piece.now ? "on-soft" : "surface2");
    this.c.fillRect(left, y, wide, ROW - 2);
    this.c.strokeStyle = colour(piece.now ? "on" : "line2");
    if (wide > 3) this.c.strokeRect(left + 0.5, y + 0.5, wide - 1, ROW - 3);
    if (this.isChosen(path)) this.ring(left, y, wide, ROW - 2);
    this.c.font = `${piece.now ? 600 : 450} 11px ${colour("font")}`;
    if (this.fits(piece.name, wide)) this.text(piece.name, left + 5, y + 9, piece.now ? "on-ink" : "ink2", piece.now ? 600 : 450);
    targets.push({ x: left, y, width: wide, height: ROW - 2, path });
  }

  private groups(top: number): void {
    const tables = studio().tables;
    const groups = Object.values(tables.groups).sort((a, b) => a.number - b.number);
    const rows = new Map(groups.map((group, index) => [group.name, top + index * LANE]));
    const loads = useLoad.getState().load?.groups ?? {};
    for (const group of groups) {
      const y = rows.get(group.name)!;
      this.c.fillStyle = colour(groupClass(tables, group.name).split(" ")[0] || "loop");
      this.c.fillRect(12, y + 5, 8, 8);
      this.text(group.name, 26, y + 9.5, "ink2", 600);
      this.c.textAlign = "right";
      if (record.cursor === null) this.text(percent(loads[group.name]?.busy_share ?? 0), GUTTER - 8, y + 9.5, "ink3");
      this.c.textAlign = "left";
      this.c.fillStyle = colour("line");
      this.c.fillRect(GUTTER, y + 15, this.width - GUTTER - RIGHT, 1);
    }
    for (let index = record.boxes.length - 1; index >= 0; index--) {
      const box = record.boxes[index]!;
      if (box[3] < scale.begin - 1) break;
      const y = rows.get(box[1]);
      if (y !== undefined) this.box(box, y, groupClass(tables, box[1]).split(" ")[0] || "loop");
    }
  }

  private box([node, , begin, end]: Box, y: number, token: string): void {
    if (end < scale.begin || begin > scale.begin + scale.length) return;
    const left = Math.max(GUTTER, this.x(begin));
    const mark = end === begin; // of a recording, which does not know how long it took
    const wide = Math.max(mark ? 2 : 1, this.x(end) - left);
    const tall = mark ? 11 : scale.length < 3 ? 13 : Math.max(3, 13 * Math.min(1, Math.max(0.28, (end - begin) / SLOWEST_S)));
    const chosen = this.isChosen(node);
    this.c.fillStyle = colour(chosen && wide < RING_PX ? "you" : token);
    this.c.fillRect(left, y + 15 - tall, wide, tall);
    if (chosen && wide >= RING_PX) this.ring(left, y + 1, wide, 13);
    if (wide > 30) {
      this.c.font = `500 10.5px ${colour("font")}`;
      const name = nameOf(node);
      if (this.fits(name, wide)) this.text(name, left + 3, y + 9, "surface", 500, 10.5);
    }
    if (wide >= 2) targets.push({ x: left, y: y + 2, width: wide, height: 13, path: node });
  }

  private isChosen(path: string): boolean {
    if (this.selection.size === 0) return false;
    return this.selection.has(path);
  }

  private ring(x: number, y: number, width: number, height: number): void {
    this.c.strokeStyle = colour("you");
    this.c.lineWidth = 2;
    this.c.strokeRect(x, y, width, height);
    this.c.lineWidth = 1;
  }

  /** The time that a recording shows: put by the person, so it is blue. */
  private cursor(at: number): void {
    const x = this.x(at);
    if (x < GUTTER - 1 || x > this.width - RIGHT + 1) return;
    const words = `${at.toFixed(scale.length < 3 ? 3 : 2)} s`;
    this.c.font = `600 11px ${colour("font")}`;
    const wide = this.c.measureText(words).width + 10;
    const left = Math.min(Math.max(GUTTER, x - wide / 2), this.width - wide - 2);
    this.c.fillStyle = colour("you");
    this.c.fillRect(Math.round(x) - 1, 40, 2, this.height - 40);
    this.c.beginPath();
    this.c.roundRect(left, 26, wide, 15, 3);
    this.c.fill();
    this.text(words, left + 5, 34, "surface", 600);
  }

  private playhead(): void {
    if (record.cursor !== null) {
      this.cursor(record.cursor);
      return;
    }
    const x = this.x(record.now);
    if (x < GUTTER || x > this.width) return;
    const active = Object.keys(studio().activity.since).length > 0;
    this.c.fillStyle = colour(active ? "on" : "ink2");
    this.c.fillRect(Math.min(x, this.width - RIGHT + 1) - 1, 28, 2, this.height - 28);
  }
}

const full = (prefix: string, path: string): string => (prefix === "" ? path : `${prefix}/${path}`);
