/** A text in parts, and which of them somebody has typed, in any order of the words. */
export function partsOf(text: string, words: string): [part: string, typed: boolean][] {
  const typed = words.toLowerCase().split(/\s+/).filter((word) => word.length > 1);
  if (typed.length === 0) return [[text, false]];
  const some = typed.map((word) => word.replace(/[^\p{L}\p{N}]/gu, "\\$&")).join("|");
  return text
    .split(new RegExp(`(${some})`, "giu"))
    .map((part, at): [string, boolean] => [part, at % 2 === 1])
    .filter(([part]) => part !== "");
}
