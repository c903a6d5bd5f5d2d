import { expect, it } from "vitest";
import { placeOf } from "./place";

it("a step of the tour stands beside what it is about, where there is room", () => {
  expect(placeOf({ left: 100, right: 300, top: 200, bottom: 260 }, 160, 1440, 900)).toEqual({ left: 316, top: 192, side: "right" });
  expect(placeOf({ left: 1120, right: 1440, top: 44, bottom: 868 }, 160, 1440, 900)).toEqual({ left: 800, top: 52, side: "left" });
  expect(placeOf({ left: 44, right: 1120, top: 690, bottom: 868 }, 160, 1120, 900)).toEqual({ left: 204, top: 514, side: "above" });
});

it("a step of the tour hides as little as possible of the other nodes", () => {
  const box = { left: 470, right: 645, top: 250, bottom: 320 };
  const mission = { left: 680, right: 860, top: 240, bottom: 520 };
  const camera = { left: 180, right: 450, top: 250, bottom: 320 };
  expect(placeOf(box, 160, 1440, 900, [mission, camera]).side).toBe("above");
  const start = { left: 400, right: 800, top: 60, bottom: 200 };
  expect(placeOf(box, 160, 1440, 900, [mission, camera, start]).side).toBe("below");
});
