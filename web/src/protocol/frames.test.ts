import { expect, it } from "vitest";
import { readFlows, readFrame, readMeasures } from "./frames";

function measures(): ArrayBuffer {
  const buffer = new ArrayBuffer(16 + 124);
  const view = new DataView(buffer);
  view.setUint8(0, 1);
  view.setUint16(2, 7, true);
  view.setUint32(4, 12, true);
  view.setFloat64(8, 54.8, true);
  view.setUint8(16, 128 + 2);
  view.setUint8(17, 2);
  view.setUint32(20, 548, true);
  view.setFloat32(24, 0.5, true);
  view.setFloat32(32, 9.5, true);
  view.setFloat32(16 + 28 + 22 * 4, 1, true);
  view.setFloat32(16 + 28 + 23 * 4, 2, true);
  return buffer;
}

it("a frame says what it is and for whom", () => {
  const frame = readFrame(measures());
  expect([frame.kind, frame.sub, frame.seq, frame.time]).toEqual([1, 7, 12, 54.8]);
});

it("a measure has its state, its figures and only the bars that are valid", () => {
  const [one] = readMeasures(readFrame(measures()).body);
  expect(one).toMatchObject({ state: "waiting", active: true, count: 548, median: 0.5, rate: 9.5 });
  expect([...one!.bars]).toEqual([1, 2]);
});

it("half a record is none", () => {
  expect(readFlows(new DataView(new ArrayBuffer(13)))).toHaveLength(1);
});
