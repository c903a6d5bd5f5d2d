import { expect, it } from "vitest";
import { placeOf } from "./place";

it("a step of the tour stands beside what it is about, where there is room", () => {
  expect(placeOf({ left: 100, right: 300, top: 200, width: 200 }, 160, 1440, 900)).toEqual({ left: 316, top: 192, side: "right" });
  expect(placeOf({ left: 1120, right: 1440, top: 44, width: 320 }, 160, 1440, 900)).toEqual({ left: 800, top: 52, side: "left" });
  expect(placeOf({ left: 44, right: 1120, top: 690, width: 1076 }, 160, 1120, 900)).toEqual({ left: 204, top: 514, side: "above" });
});
