import { describe, expect, it } from "vitest";
import type { NodeBox } from "../protocol/types";
import { aligned, distributed } from "./aligning";

const box = (id: string, x: number, y: number, width = 176, height = 72) => ({ id, x, y, width, height }) as NodeBox;
const boxes = [box("a", 0, 0), box("b", 304, 40), box("c", 800, 160, 96, 48)];

describe("a selection", () => {
  it("is aligned at the side of what lies farthest out", () => {
    expect(aligned(boxes, "left").map(([x]) => x)).toEqual([0, 0, 0]);
    expect(aligned(boxes, "right").map(([x]) => x)).toEqual([720, 720, 800]);
    expect(aligned(boxes, "bottom").map(([, y]) => y)).toEqual([136, 136, 160]);
  });
  it("is distributed with equal gaps, and its ends stay", () => {
    expect(distributed(boxes, "x").map(([x]) => x)).toEqual([0, 400, 800]);
    expect(distributed(boxes, "y").map(([, y]) => y)).toEqual([0, 80, 160]);
  });
  it("that lies in another order keeps that order", () => {
    expect(distributed([boxes[2]!, boxes[0]!, boxes[1]!], "x").map(([x]) => x)).toEqual([800, 0, 400]);
  });
});
