import { Divider } from "../shell/Divider";
import { change, type Tab, useStudio } from "../state/studio";
import { HistoryList } from "./HistoryList";
import { Log } from "./Log";
import { ProblemList } from "./ProblemList";
import { Timeline } from "./Timeline";
import { TimelineButtons } from "./TimelineButtons";

export function BottomPanel() {
  const tab = useStudio((s) => s.tab);
  const open = useStudio((s) => s.time);
  const errors = useStudio((s) => Object.values(s.tables.problems).filter((one) => one.severity === "error").length);
  const problems = useStudio((s) => Object.keys(s.tables.problems).length);
  const steps = useStudio((s) => s.tables.studio.history?.done.length ?? 0);
  return (
    <section id="time" aria-label="Timeline, problems, log and history">
      {open && <Divider way="h" variable="--time" usual={156} least={64} most={600} label="Height of the timeline" />}
      <div className="tabs">
        <div role="tablist" aria-label="Panels at the bottom" className="row" style={{ gap: 2 }}>
          <TabButton tab="timeline" now={tab} label="Timeline" />
          <TabButton tab="problems" now={tab} label="Problems" count={problems} bad={errors > 0} />
          <TabButton tab="log" now={tab} label="Log" roomy />
          <TabButton tab="history" now={tab} label="History" count={steps} roomy />
        </div>
        <span className="spring" />
        {open && tab === "timeline" && <TimelineButtons />}
      </div>
      {open && (
        <div className="body" role="tabpanel" id={`panel-${tab}`} aria-label={tab}>
          {tab === "timeline" && <Timeline />}
          {tab === "problems" && <ProblemList />}
          {tab === "log" && <Log />}
          {tab === "history" && <HistoryList />}
        </div>
      )}
    </section>
  );
}

interface TabProps {
  tab: Tab;
  now: Tab;
  label: string;
  count?: number;
  bad?: boolean;
  /** Left out where the window is narrow. */
  roomy?: boolean;
}

function TabButton({ tab, now, label, count, bad, roomy }: TabProps) {
  const chosen = tab === now;
  return (
    <button type="button" role="tab" aria-selected={chosen} className={`tab${chosen ? " sel" : ""}${roomy && !chosen ? " hide-n" : ""}`} onClick={() => change({ tab, time: true })}>
      {label}
      {count !== undefined && <span className={bad ? "pill bad" : "pill"}>{count}</span>}
    </button>
  );
}
