import { expect, it } from "vitest";
import type { Op } from "../protocol/types";
import { applied, EMPTY, fromSnapshot } from "./replica";

const put = (key: string, record: unknown): Op => ["gates", key, record];

it("records are put, replaced and dropped in order", () => {
  const tables = applied(EMPTY, [put("a", { by: "x" }), put("b", { by: "y" }), put("a", { by: "z" }), put("b", null)]);
  expect(tables.gates).toEqual({ a: { by: "z" } });
});

it("what a patch does not name stays the same object", () => {
  const before = fromSnapshot({ gates: {} });
  const after = applied(before, [put("a", { by: "x" })]);
  expect(after.nodes).toBe(before.nodes);
  expect(before.gates).toEqual({});
});
