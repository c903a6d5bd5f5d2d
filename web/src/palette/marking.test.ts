import { expect, it } from "vitest";
import { partsOf } from "./marking";

it("letters that were typed are marked wherever they are", () => {
  expect(partsOf("Adaptive threshold", "thresh")).toEqual([["Adaptive ", false], ["thresh", true], ["old", false]]);
  expect(partsOf("read_image", "im read")).toEqual([["read", true], ["_", false], ["im", true], ["age", false]]);
  expect(partsOf("a + b (c)", "+ (c)")).toEqual([["a + b ", false], ["(c)", true]]);
  expect(partsOf("anything", " ")).toEqual([["anything", false]]);
});
