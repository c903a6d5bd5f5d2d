import { expect, it } from "vitest";
import { below, edgeKey, endsOf, isInside, nameOf, nodeOf, parentOf, portOf } from "./paths";

it("paths are taken apart as commands write them", () => {
  expect(parentOf("fetch/go_to")).toBe("fetch");
  expect(parentOf("fetch")).toBe("");
  expect(nameOf("fetch/go_to")).toBe("go_to");
  expect(nodeOf("fetch/go_to.goal")).toBe("fetch/go_to");
  expect(nodeOf("fetch.person.inner")).toBe("fetch");
  expect(portOf("fetch.person.inner")).toBe("person.inner");
  expect(endsOf(edgeKey("a.out", "fetch.person"))).toEqual(["a.out", "fetch.person"]);
});

it("what is inside is said in words", () => {
  expect(below("fetch/visit/position", "fetch")).toBe("visit › position");
  expect(isInside("fetcher", "fetch")).toBe(false);
  expect(isInside("fetch/a", "fetch")).toBe(true);
});
