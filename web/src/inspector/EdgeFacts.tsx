import { useEffect, useState } from "react";
import type { Value } from "../protocol/types";
import { disconnect, edit, makeActive, pin } from "../state/actions";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { rate } from "../ui/words";

export function EdgeFacts({ edge: key }: { edge: string }) {
  const edge = useStudio((s) => s.tables.edges[key]);
  const [value, setValue] = useState<Value | null>(null);
  useEffect(() => {
    setValue(null);
    return socket.subscribe("value", { path: key }, 4, (next) => setValue(next as Value)).end;
  }, [key]);
  if (!edge) return null;
  const capacity = edge.options.capacity;
  const setCapacity = (text: string) => {
    const number = Number(text);
    if (Number.isInteger(number) && number > 0) void edit([{ do: "SetEdge", source: edge.source, target: edge.target, capacity: number }]);
  };
  return (
    <>
      <div className="who">
        <h2 className="n">Edge</h2>
        <p>
          {edge.source} → {edge.target}
        </p>
        <p className="muted num">
          {edge.signal ? "asynchronous" : "synchronous"}
          {edge.active ? ", transports activity" : ""}
          {value ? ` · ${rate(value.rate_hz)}` : ""}
        </p>
      </div>
      <div className="sec">
        <h3>Last value</h3>
        <p className="second num" style={{ overflowWrap: "anywhere" }}>
          {value ? value.message || value.summary : "nothing was sent yet"}
        </p>
        <div className="remedies">
          <button type="button" className="btn line" onClick={() => pin(key)}>
            Pin a probe
          </button>
          <button type="button" className="btn line" onClick={() => void makeActive(key)}>
            {edge.active ? "Make it passive" : "Make it active"} <kbd>A</kbd>
          </button>
          <button type="button" className="btn line" onClick={() => void disconnect(key)}>
            Delete the edge
          </button>
        </div>
      </div>
      <div className="sec">
        <h3>Settings</h3>
        <div className="par">
          <label htmlFor="capacity">capacity</label>
          <div className="fld wide">
            <input
              id="capacity"
              inputMode="numeric"
              placeholder="as usual"
              key={String(capacity)}
              defaultValue={typeof capacity === "number" ? capacity : ""}
              onBlur={(event) => event.target.value !== String(capacity ?? "") && setCapacity(event.target.value)}
              onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
            />
          </div>
        </div>
        {edge.through && edge.through.length > 0 && <p className="mono said">{JSON.stringify(edge.through, null, 1)}</p>}
      </div>
    </>
  );
}
