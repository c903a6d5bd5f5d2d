import { question, toast } from "./actions";
import { studio } from "./studio";

/** Twice as fine as on the screen, for documents. */
const SCALE = 2;

export function saveAs(name: string, blob: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

async function said<T>(what: string, args: Record<string, unknown>): Promise<T | null> {
  try {
    return await question<T>(what, args);
  } catch (error) {
    toast(error instanceof Error ? error.message : String(error), { kind: "bad" });
    return null;
  }
}

const picture = () => {
  const { level, views } = studio();
  return said<{ name: string; svg: string }>("svg", { level, view: views[level] ?? "" });
};

export async function saveSvg(): Promise<void> {
  const found = await picture();
  if (found) saveAs(found.name, new Blob([found.svg], { type: "image/svg+xml" }));
}

/** The browser itself draws the SVG. */
export async function savePng(): Promise<void> {
  const found = await picture();
  if (!found) return;
  const url = URL.createObjectURL(new Blob([found.svg], { type: "image/svg+xml" }));
  const image = new Image();
  image.src = url;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = image.naturalWidth * SCALE;
  canvas.height = image.naturalHeight * SCALE;
  canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(url);
  canvas.toBlob((blob) => blob && saveAs(found.name.replace(/svg$/, "png"), blob), "image/png");
}

export async function saveValue(path: string, kind: "csv" | "npy"): Promise<void> {
  const found = await said<{ name: string; base64: string }>("value_file", { path, kind });
  if (!found) return;
  const bytes = Uint8Array.from(atob(found.base64), (letter) => letter.charCodeAt(0));
  saveAs(found.name, new Blob([bytes], { type: kind === "csv" ? "text/csv" : "application/octet-stream" }));
}
