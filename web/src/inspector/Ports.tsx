import { useEffect, useRef } from "react";
import type { PortRecord, Value } from "../protocol/types";
import { pin } from "../state/actions";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { rate } from "../ui/words";

export function Ports({ path }: { path: string }) {
  const ports = useStudio((s) => s.tables.nodes[path]?.ports);
  const shown = ports?.filter((port) => port.kind !== "parameter" && (!port.auto || port.used)) ?? [];
  if (shown.length === 0) return null;
  return (
    <div className="sec">
      <h3>
        Ports<span className="sp" />
        <small>last value</small>
      </h3>
      {shown.map((port) => (
        <PortRow key={`${port.kind}.${port.name}`} port={port} />
      ))}
    </div>
  );
}

function PortRow({ port }: { port: PortRecord }) {
  const value = useRef<HTMLSpanElement>(null);
  const speed = useRef<HTMLSpanElement>(null);
  const pinned = useStudio((s) => s.pins.includes(port.path));
  useEffect(() => {
    let shown = false;
    const subscription = socket.subscribe("value", { path: port.path }, 4, (next) => {
      const one = next as Value | null;
      if (value.current) {
        const silent = one !== null && one.kind === "marker";
        // What it sent before it fell silent is still of interest; it looks old.
        if (!silent || !shown) value.current.textContent = one === null || one.kind === "none" ? "" : silent ? "silent" : one.summary;
        shown ||= one !== null && one.kind !== "none" && !silent;
        value.current.classList.toggle("muted", silent);
        value.current.title = value.current.textContent;
      }
      if (speed.current) speed.current.textContent = one !== null && one.seen > 0 ? rate(one.rate_hz) : "never";
    });
    return subscription.end;
  }, [port.path, port.used]);
  const round = port.kind === "slot" || port.kind === "event";
  return (
    <div className="prt">
      <i className={round ? "ci" : "sq"} title={port.kind} />
      <span>
        <button type="button" title={pinned ? "unpin" : "pin a probe"} aria-pressed={pinned} onClick={() => pin(port.path)}>
          {port.name}
        </button>
        <em title={port.type}>{port.type}</em>
      </span>
      <span className="v num" ref={value} />
      <span className="r num" ref={speed} />
    </div>
  );
}
