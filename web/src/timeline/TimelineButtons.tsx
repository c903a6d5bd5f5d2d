import { isRecording } from "../state/looking";
import { useStudio } from "../state/studio";
import { saveAs } from "../state/capturing";
import { Icon } from "../ui/Icon";
import { record, useWindow } from "./store";

const LENGTHS = [0.3, 1, 3, 14, 60, 300];

export function TimelineButtons() {
  const { follows, length } = useWindow();
  const recording = useStudio((s) => isRecording(s.tables.studio.run));
  const last = (seconds: number) => `${recording ? "" : "last "}${seconds >= 2 ? `${Math.round(seconds)} s` : `${Math.round(seconds * 1000)} ms`}`;
  const toggle = () => useWindow.setState(recording ? { follows: !follows } : { follows: !follows, end: record.now });
  return (
    <>
      <button
        type="button"
        className="btn small line"
        aria-pressed={follows}
        style={follows ? { color: "var(--you)", borderColor: "var(--you)" } : undefined}
        title={recording ? "Keep the cursor in view (L)" : "Follow live (L)"}
        onClick={toggle}
      >
        <Icon name="follow" />
        {follows ? "Follows" : "Follow"}
      </button>
      <label className="btn small hide-n">
        <select
          aria-label="Length of the window"
          value={LENGTHS.includes(length) ? length : ""}
          onChange={(event) => widen(Number(event.target.value))}
          style={{ border: 0, background: "none" }}
        >
          {!LENGTHS.includes(length) && <option value="">{last(length)}</option>}
          {LENGTHS.map((one) => (
            <option key={one} value={one}>
              {last(one)}
            </option>
          ))}
        </select>
      </label>
      <button type="button" className="btn small hide-n" onClick={savePerfetto} title="Open the file at ui.perfetto.dev or in Chrome">
        Save as Perfetto
      </button>
    </>
  );
}

/** Shows more or less of the time around the cursor, or up to the end of the run. */
function widen(length: number): void {
  const end = Math.min(Math.max((record.cursor ?? 0) + length / 2, length), Math.max(record.now, length));
  useWindow.setState(record.cursor === null ? { length } : { length, end });
}

/** The boxes that the page has, in the trace format of Chrome and Perfetto. */
function savePerfetto(): void {
  const lanes = [...new Set(record.boxes.map((box) => box[1]))];
  const events = record.boxes.map(([node, group, begin, end]) => ({
    name: node,
    ph: "X",
    ts: begin * 1e6,
    dur: (end - begin) * 1e6,
    pid: 1,
    tid: lanes.indexOf(group) + 1,
  }));
  const names = lanes.map((name, index) => ({ name: "thread_name", ph: "M", pid: 1, tid: index + 1, args: { name } }));
  saveAs("timeline.json", new Blob([JSON.stringify({ traceEvents: [...names, ...events] })], { type: "application/json" }));
}
