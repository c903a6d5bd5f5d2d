import { stepTo } from "../live/replay";
import { chosen, locked, pauseOrGo, step, tell, unsteerable } from "../state/actions";
import { isRecording } from "../state/looking";
import { useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";

/** Pause and go on, a wave, a firing, stop: in the middle of the bar, where they stay in the narrowest window. */
export function RunControl() {
  const recording = useStudio((s) => isRecording(s.tables.studio.run));
  return recording ? <Player /> : <Steering />;
}

/** Of a recording: back a firing, play or pause, on a firing. */
function Player() {
  const plays = useStudio((s) => s.tables.studio.run?.state === "running");
  useStudio((s) => s.age === 3);
  const off = unsteerable() !== "";
  const goes = plays ? "Pause (Space)" : "Play (Space)";
  return (
    <span className="group" role="group" aria-label="Recording" title={unsteerable() || undefined}>
      <button type="button" className="btn" title="To the firing before (←)" aria-label="To the firing before" disabled={off} onClick={() => void stepTo(true)}>
        <Icon name="back" />
      </button>
      <button type="button" className="btn" title={goes} aria-label={goes} disabled={off} onClick={pauseOrGo}>
        <Icon name={plays ? "pause" : "play"} />
      </button>
      <button type="button" className="btn" title="To the next firing (→)" aria-label="To the next firing" disabled={off} onClick={() => void stepTo(false)}>
        <Icon name="wave" />
      </button>
    </span>
  );
}

function Steering() {
  const state = useStudio((s) => s.tables.studio.run?.state ?? "rest");
  const one = useStudio((s) => (s.selection.size === 1 ? [...s.selection][0]! : ""));
  useStudio((s) => s.age === 3); // the buttons lock with the edits
  const why = locked();
  const moves = state === "running" || state === "starting" || state === "stepping";
  const at_rest = state === "rest" || state === "ended";
  const goes = moves ? "Pause (Space)" : at_rest ? "Start (Space)" : "Go on (Space)";
  const off = why !== "";
  return (
    <span className="group" role="group" aria-label="Run" title={why || undefined}>
      <button type="button" className="btn" title={why || goes} aria-label={goes} disabled={off} onClick={pauseOrGo}>
        <Icon name={moves ? "pause" : "play"} />
      </button>
      <button type="button" className="btn" title="Step a wave (.)" aria-label="Step a wave" disabled={off || at_rest} onClick={() => void step("")}>
        <Icon name="wave" />
      </button>
      <button
        type="button"
        className="btn"
        title="Step a firing of the selected node (,)"
        aria-label="Step a firing of the selected node"
        disabled={off || at_rest || one === ""}
        onClick={() => void step(chosen()[0] ?? "")}
      >
        <Icon name="step" />
      </button>
      <button type="button" className="btn" title="Stop (Shift+Esc)" aria-label="Stop" disabled={off || at_rest} onClick={() => void tell("stop")}>
        <Icon name="stop" />
      </button>
    </span>
  );
}
