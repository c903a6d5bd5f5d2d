import { useEffect, useState } from "react";
import { socket } from "../state/link";

type Line = [time: number, level: string, path: string, text: string];
const MOST = 500;

export function Log() {
  const [lines, setLines] = useState<Line[]>([]);
  useEffect(
    () =>
      socket.subscribe("log", {}, 4, (value) => {
        const { records } = value as { records: Line[] };
        if (records.length > 0) setLines((before) => [...before, ...records].slice(-MOST));
      }).end,
    [],
  );
  if (lines.length === 0) return <p className="empty">Nothing was logged since you opened the log.</p>;
  return (
    <div className="log">
      {lines.map(([time, level, path, text], index) => (
        <div key={`${time} ${index}`}>
          {time.toFixed(2).padStart(8)} {level.padEnd(7)} {path} {text}
        </div>
      ))}
    </div>
  );
}
