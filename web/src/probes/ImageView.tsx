import { useEffect, useRef } from "react";
import { readPicture } from "../protocol/frames";
import { socket } from "../state/link";

export function ImageView({ path, caption }: { path: string; caption: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    let gone = false;
    const subscription = socket.subscribe("image", { path, size: 640, quality: 80 }, 15, (_, __, frame) => {
      if (frame) void paint(readPicture(frame.body).blob);
    });
    const paint = async (blob: Blob) => {
      const bitmap = await createImageBitmap(blob);
      const element = canvas.current;
      if (element && !gone) {
        if (element.width !== bitmap.width || element.height !== bitmap.height) {
          element.width = bitmap.width;
          element.height = bitmap.height;
        }
        element.getContext("2d")?.drawImage(bitmap, 0, 0);
      }
      bitmap.close();
    };
    return () => {
      gone = true;
      subscription.end();
    };
  }, [path]);
  return (
    <div className="im" style={{ height: "auto", minHeight: 96 }}>
      <canvas ref={canvas} width={4} height={3} role="img" aria-label={caption} data-probe={path} />
      <span className="cap num">{caption}</span>
    </div>
  );
}
