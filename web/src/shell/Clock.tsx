import { useEffect, useRef } from "react";
import { elapsed, isRecording } from "../state/looking";
import { studio, useStudio } from "../state/studio";
import type { RunRecord } from "../protocol/types";
import { clock } from "../ui/words";

/** The time of the run, four times a second, and whether what one sees is live. */
export function Clock() {
  const run = useStudio((s) => s.tables.studio.run);
  const text = useRef<HTMLSpanElement>(null);

  useEffect(() => {
    const paint = () => {
      const state = studio();
      if (state.age === 3 || !text.current) return;
      text.current.textContent = clock(elapsed(state.tables.studio.run, state.clockOffset));
    };
    paint();
    const timer = setInterval(paint, isRecording(run) ? 50 : 250);
    return () => clearInterval(timer);
  }, [run]);

  return (
    <span className="clock num">
      <span ref={text} style={{ minWidth: 52, textAlign: "right" }}>
        0.00 s
      </span>
      <small>{says(run)}</small>
      <Live />
    </span>
  );
}

function says(run: RunRecord | undefined): string {
  if (!run || run.state === "rest") return "at rest";
  if (isRecording(run)) return `of ${clock(run.length_s ?? 0)}`;
  if (run.state === "ended") return "ended";
  if (run.state === "paused") return run.why && run.why !== "pause" ? `held at ${run.why}` : "paused";
  if (run.state === "running") return run.clock === "real" ? "real time" : `${run.clock} time`;
  return run.state;
}

function Live() {
  const run = useStudio((s) => s.tables.studio.run);
  const phase = useStudio((s) => s.phase);
  const age = useStudio((s) => s.age);
  const seconds = useStudio((s) => s.ageSeconds);
  const readOnly = useStudio((s) => s.hello?.read_only ?? "");
  const lock = readOnly !== "" && <span title={readOnly}>look only</span>;
  if (phase === "connecting") return <span className="live off">connecting</span>;
  if (age > 0) return <span className="live off">away {seconds} s</span>;
  if (isRecording(run)) return <span className="live off">recording</span>;
  if (run?.state === "ended" && run.outcome === "failed") return <span className="live bad">failed</span>;
  if (run?.state === "ended") return <span className="live off">{run.outcome || "ended"}</span>;
  if (!run || run.state === "rest") return <span className="live off">ready {lock}</span>;
  return (
    <>
      <span className="live">live</span>
      {lock && <small className="muted">{lock}</small>}
    </>
  );
}
