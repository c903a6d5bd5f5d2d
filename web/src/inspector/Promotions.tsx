import type { Command } from "../protocol/types";
import { edit, locked, newGesture } from "../state/actions";
import { parentOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { useAnswer } from "../state/useAnswer";

interface Promotion {
  name: string;
  by: string;
  none: Command[];
  rows: { name: string; message: string; commands: Command[] }[];
}

/** Which parameters of the subgraph around stand for those of the node. */
export function Promotions({ path }: { path: string }) {
  const found = useAnswer<Promotion[]>("promotions", { path });
  const off = useStudio((s) => s.age === 3) || locked() !== "";
  const shown = (found ?? []).filter((one) => one.rows.length > 0);
  if (shown.length === 0) return null;
  return (
    <div className="sec">
      <h3>
        Set from outside<span className="sp" />
        <small>by parameters of {parentOf(path)}</small>
      </h3>
      {shown.map((one) => (
        <div className="par" key={one.name}>
          <label htmlFor={`promoted-${one.name}`}>{one.name.replaceAll("_", " ")}</label>
          <div className="fld wide">
            <select
              id={`promoted-${one.name}`}
              value={one.by}
              disabled={off}
              onChange={(event) => void edit(one.rows.find((row) => row.name === event.target.value)?.commands ?? one.none, newGesture())}
            >
              <option value="">set here</option>
              {one.rows.map((row) => (
                <option key={row.name} value={row.name} disabled={row.message !== ""} title={row.message}>
                  {row.name}
                  {row.message !== "" ? " (does not fit)" : ""}
                </option>
              ))}
            </select>
          </div>
        </div>
      ))}
    </div>
  );
}
