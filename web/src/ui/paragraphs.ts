/** A docstring with the breaks of its lines taken out: those of paragraphs, lists and code stay. */
export function unwrapped(text: string): string {
  return text
    .split(/\n\s*\n/)
    .map((part) => (/^( |\t|[-*>]|\d+\.)/m.test(part) ? part : part.replaceAll("\n", " ")))
    .join("\n\n");
}

/** Without the marks of code, which mean nothing here. */
export const plain = (text: string): string => text.replaceAll("`", "");
