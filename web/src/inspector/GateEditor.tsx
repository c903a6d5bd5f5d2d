import type { Command } from "../protocol/types";
import { edit, locked, newGesture } from "../state/actions";
import { useStudio } from "../state/studio";
import { useAnswer } from "../state/useAnswer";
import { Fixed } from "./Fixed";

interface Gates {
  by: string;
  rows: { path: string; commands: Command[] }[];
  none: Command[];
  idle_rate_hz: number | null;
}

/** Whose activity opens a node, and how often it still fires while closed. */
export function GateEditor({ path, fixed }: { path: string; fixed: boolean }) {
  const gates = useAnswer<Gates>("gates", { path });
  const off = useStudio((s) => s.age === 3) || locked() !== "";
  if (!gates) return null;
  if (fixed) return <Fixed name="works while" value={gates.by === "" ? "always" : said(gates.by, path)} />;
  const choose = (by: string) => void edit(by === "" ? gates.none : (gates.rows.find((row) => row.path === by)?.commands ?? []), newGesture());
  const setRate = (text: string) => {
    const rate = text.trim() === "" ? null : Number(text.replace(",", "."));
    const commands = gates.rows.find((row) => row.path === gates.by)?.commands ?? [];
    if (rate === gates.idle_rate_hz || Number.isNaN(rate)) return;
    void edit(commands.map((one) => (one.do === "Gate" ? { ...one, idle_rate_hz: rate } : one)));
  };
  return (
    <>
      <div className="par" title="The node works only while the other one is active.">
        <label htmlFor="gate">works while</label>
        <div className="fld wide">
          <select id="gate" value={gates.by} disabled={off} onChange={(event) => choose(event.target.value)}>
            <option value="">always</option>
            {gates.rows.map((row) => (
              <option key={row.path} value={row.path}>
                {said(row.path, path)}
              </option>
            ))}
          </select>
        </div>
      </div>
      {gates.by !== "" && (
        <div className="par" title="How often a second it fires while its gate is closed; empty: it rests.">
          <label htmlFor="idle-rate">else at most</label>
          <div className="fld wide">
            <input
              id="idle-rate"
              key={String(gates.idle_rate_hz)}
              inputMode="decimal"
              placeholder="rests"
              readOnly={off}
              defaultValue={gates.idle_rate_hz ?? ""}
              onBlur={(event) => setRate(event.target.value)}
              onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
            />
            <u>Hz</u>
          </div>
        </div>
      )}
    </>
  );
}

const said = (by: string, path: string): string => (by === path ? "it is active" : `${by.split("/").join(" › ")} is active`);
