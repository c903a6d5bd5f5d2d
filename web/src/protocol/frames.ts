/** Binary frames: a header of 16 bytes, then records of fixed size. */

export interface Frame {
  kind: number;
  sub: number;
  seq: number;
  time: number;
  body: DataView;
}

export const BARS = 24;
const HEADER = 16;
const MEASURE = 28 + 4 * BARS;
const FLOW = 12;
const ACTIVE = 128;

const STATES = ["idle", "working", "waiting", "disabled", "ended", "failed"] as const;
export type WorkState = (typeof STATES)[number];

export interface Measure {
  state: WorkState;
  active: boolean;
  bars: Float32Array;
  count: number;
  median: number;
  p99: number;
  rate: number;
  activeShare: number;
  busyShare: number;
}

export interface Flow {
  sent: number;
  untaken: number;
  rate: number;
}

export function readFrame(buffer: ArrayBuffer): Frame {
  const view = new DataView(buffer);
  return {
    kind: view.getUint8(0),
    sub: view.getUint16(2, true),
    seq: view.getUint32(4, true),
    time: view.getFloat64(8, true),
    body: new DataView(buffer, HEADER),
  };
}

export function readMeasures(body: DataView): Measure[] {
  const count = Math.floor(body.byteLength / MEASURE);
  return Array.from({ length: count }, (_, index) => readMeasure(body, index * MEASURE));
}

function readMeasure(body: DataView, at: number): Measure {
  const state = body.getUint8(at);
  const valid = Math.min(BARS, body.getUint8(at + 1));
  const bars = new Float32Array(valid);
  for (let index = 0; index < valid; index++) {
    bars[index] = body.getFloat32(at + 28 + 4 * (BARS - valid + index), true);
  }
  return {
    state: STATES[state & (ACTIVE - 1)] ?? "idle",
    active: state >= ACTIVE,
    bars,
    count: body.getUint32(at + 4, true),
    median: body.getFloat32(at + 8, true),
    p99: body.getFloat32(at + 12, true),
    rate: body.getFloat32(at + 16, true),
    activeShare: body.getFloat32(at + 20, true),
    busyShare: body.getFloat32(at + 24, true),
  };
}

export function readFlows(body: DataView): Flow[] {
  const count = Math.floor(body.byteLength / FLOW);
  return Array.from({ length: count }, (_, index) => ({
    sent: body.getUint32(index * FLOW, true),
    untaken: body.getUint32(index * FLOW + 4, true),
    rate: body.getFloat32(index * FLOW + 8, true),
  }));
}

export interface Picture {
  width: number;
  height: number;
  blob: Blob;
}

export function readPicture(body: DataView): Picture {
  const bytes = new Uint8Array(body.buffer, body.byteOffset + 4, body.byteLength - 4) as Uint8Array<ArrayBuffer>;
  const type = bytes[0] === 0x89 ? "image/png" : "image/jpeg";
  return {
    width: body.getUint16(0, true),
    height: body.getUint16(2, true),
    blob: new Blob([bytes], { type }),
  };
}
