import { expect, it } from "vitest";
import type { NodeRecord, TypeRecord } from "../protocol/types";
import { firstViews, offersOf } from "./offered";

const nodes = {
  world: { path: "world", type: "m:World", title: "World" },
  robot_0: { path: "robot_0", type: "~robot_0", title: "Robot" },
  robot_1: { path: "robot_1", type: "~robot_1", title: "Robot" },
  plain: { path: "plain", type: "m:plain", title: "plain" },
} as unknown as Record<string, NodeRecord>;
const robot = { views: [{ name: "eyes", title: "Eyes", doc: "" }], actions: [] };
const types = {
  "m:World": { views: [{ name: "above", title: "From above", doc: "" }], actions: [{ name: "dim", label: "Dim", arguments: [] }] },
  "~robot_0": robot,
  "~robot_1": robot,
  "m:plain": { views: [], actions: [] },
} as unknown as Record<string, TypeRecord>;

it("every node of a type offers what the type offers", () => {
  const { views, actions } = offersOf(nodes, types);
  expect(views.map((one) => one.key)).toEqual(["world#above", "robot_0#eyes", "robot_1#eyes"]);
  expect(actions.map((one) => one.path)).toEqual(["world"]);
});

it("of several nodes of a type the first is shown at first", () => {
  expect(firstViews(offersOf(nodes, types).views)).toEqual(["world#above", "robot_0#eyes"]);
});
