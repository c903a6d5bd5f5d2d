import { useEffect, useRef, useState } from "react";
import type { Scene } from "../protocol/types";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { onTheme } from "../ui/colours";
import type { OfferedView } from "./offered";
import { paint, placed } from "./paint";

const EVERY_HZ = 12;

/** One view of a node, as the studio draws it now. The page knows nothing of what it shows. */
export function SceneView({ view }: { view: OfferedView }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [caption, setCaption] = useState("");
  const [why, setWhy] = useState("");
  const [there, setThere] = useState(false);
  const number = useStudio((s) => s.tables.studio.run?.number ?? 0);
  const { path, name } = view;
  useEffect(() => {
    let scene: Scene | null = null;
    let images: (ImageBitmap | null)[] = [];
    let gone = false;
    setWhy("");
    setThere(false);
    const repaint = () => scene && canvas.current && draw(canvas.current, scene, images);
    const take = async (next: Scene) => {
      const made = await Promise.all(next.shapes.flatMap((one) => (one[0] === "image" ? [bitmap(one[1])] : [])));
      for (const old of images) old?.close();
      if (gone) return;
      [scene, images] = [next, made];
      setThere(true);
      setCaption(next.caption);
      repaint();
    };
    const subscription = socket.subscribe("view", { path, name }, EVERY_HZ, (value) => void take(value as Scene), setWhy);
    const unlisten = onTheme(repaint);
    const observer = new ResizeObserver(repaint);
    if (canvas.current) observer.observe(canvas.current);
    return () => {
      gone = true;
      subscription.end();
      unlisten();
      observer.disconnect();
      for (const one of images) one?.close();
    };
  }, [path, name, number]);
  return (
    <>
      <div className="drawn">
        <canvas ref={canvas} width={4} height={3} role="img" aria-label={`${view.title}: ${caption || "nothing yet"}`} data-view={view.key} />
        {(why !== "" || !there) && <div className="says">{why || (number > 0 ? "Nothing has arrived yet." : "Nothing to see before the graph runs.")}</div>}
      </div>
      <div className="caption num">{caption}</div>
    </>
  );
}

function draw(canvas: HTMLCanvasElement, scene: Scene, images: readonly (ImageBitmap | null)[]): void {
  const width = canvas.clientWidth;
  const sharp = window.devicePixelRatio || 1;
  const { height } = placed(scene.bounds, width);
  if (canvas.width !== Math.round(width * sharp) || canvas.height !== Math.round(height * sharp)) {
    canvas.width = Math.round(width * sharp);
    canvas.height = Math.round(height * sharp);
  }
  const context = canvas.getContext("2d");
  if (!context) return;
  context.setTransform(sharp, 0, 0, sharp, 0, 0);
  paint(context, scene, width, images);
}

async function bitmap(base64: string): Promise<ImageBitmap | null> {
  try {
    return await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (one) => one.charCodeAt(0))]));
  } catch {
    return null; // the studio sent what this browser cannot show; the rest of the scene can be seen
  }
}
