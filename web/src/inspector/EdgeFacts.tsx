import { useEffect, useState } from "react";
import type { Value } from "../protocol/types";
import { disconnect, makeActive, pin } from "../state/actions";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { rate } from "../ui/words";
import { EdgeOptions } from "./EdgeOptions";
import { StopEditor } from "./StopEditor";

export function EdgeFacts({ edge: key }: { edge: string }) {
  const edge = useStudio((s) => s.tables.edges[key]);
  const [value, setValue] = useState<Value | null>(null);
  useEffect(() => {
    setValue(null);
    return socket.subscribe("value", { path: key }, 4, (next) => setValue(next as Value)).end;
  }, [key]);
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  if (!edge) return null;
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
          {!never && (
            <>
              <button type="button" className="btn line" onClick={() => void makeActive(key)}>
                {edge.active ? "Make it passive" : "Make it active"} <kbd>A</kbd>
              </button>
              <button type="button" className="btn line" onClick={() => void disconnect(key)}>
                Delete the edge
              </button>
            </>
          )}
        </div>
      </div>
      <EdgeOptions edge={key} />
      {!never && <StopEditor path={key} />}
    </>
  );
}
