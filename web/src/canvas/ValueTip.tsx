import { useEffect, useState } from "react";
import type { Value } from "../protocol/types";
import { pin } from "../state/actions";
import { socket } from "../state/link";
import { valueSeen } from "../state/looking";
import { useStudio } from "../state/studio";
import { moment, rate } from "../ui/words";
import { useTip } from "./tips";

/** Over a port or an edge: type, last value, rate. P pins it. */
export function ValueTip() {
  const { path, x, y } = useTip();
  const [value, setValue] = useState<Value | null>(null);
  const [why, setWhy] = useState("");
  const type = useStudio((s) => typeOf(s.tables.nodes, path ?? ""));

  useEffect(() => {
    setValue(null);
    setWhy("");
    if (path === null) return;
    const subscription = socket.subscribe("value", { path }, 4, (next, time) => setValue(valueSeen(next, time)), setWhy);
    const key = (event: KeyboardEvent) => {
      if (event.key.toLowerCase() === "p" && !event.ctrlKey && !(event.target instanceof HTMLInputElement)) {
        event.stopImmediatePropagation();
        pin(path);
      }
    };
    window.addEventListener("keydown", key, true);
    return () => {
      subscription.end();
      window.removeEventListener("keydown", key, true);
    };
  }, [path]);

  if (path === null) return null;
  const left = Math.min(x + 12, window.innerWidth - 340);
  return (
    <div className="pop tip-pop" style={{ position: "fixed", left, top: Math.min(y + 16, window.innerHeight - 110) }} role="tooltip">
      <div className="row">
        <b style={{ fontWeight: 600 }}>{path.replace(" -> ", " → ")}</b>
        <span className="muted">{type}</span>
      </div>
      <div className="second num">{value ? value.message || (value.kind === "marker" ? "silent: the last firing sent nothing here" : value.summary) || "nothing yet" : why || "nothing was sent yet"}</div>
      {value && (
        <div className="muted num" style={{ fontSize: 11 }}>
          {rate(value.rate_hz)} · {moment(value.time)} · <kbd>P</kbd> pin
        </div>
      )}
    </div>
  );
}

function typeOf(nodes: Record<string, { ports: { path: string; type: string }[] }>, path: string): string {
  const dot = path.indexOf(".", path.lastIndexOf("/") + 1);
  if (dot < 0 || path.includes(" -> ")) return "";
  return nodes[path.slice(0, dot)]?.ports.find((port) => port.path === path)?.type ?? "";
}
