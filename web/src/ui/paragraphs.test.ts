import { expect, it } from "vitest";
import { unwrapped } from "./paragraphs";

it("lines of a paragraph become one, lists and code stay as they are", () => {
  expect(unwrapped("All signals\nleave at once.\n\n- one\n- two\n\nThe\nend.")).toBe("All signals leave at once.\n\n- one\n- two\n\nThe end.");
  expect(unwrapped("    code\n    more")).toBe("    code\n    more");
});
