import type { Message } from "../protocol/types";
import { ask, undo } from "../state/actions";
import { portOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";

/** First the plain sentence, then buttons that are commands, then the text as it was. */
export function FailedSection({ path }: { path: string }) {
  const error = useStudio((s) => (s.tables.studio.run?.error?.path === path ? s.tables.studio.run.error : null));
  const problems = useStudio((s) => s.tables.problems);
  const last = useStudio((s) => s.tables.studio.history?.done.at(-1));
  const here = Object.values(problems).filter((one) => one.path === path || one.path.startsWith(`${path}.`));
  if (error === null && here.length === 0) return null;
  const fixes = here.flatMap((one) => one.fixes ?? []);
  return (
    <>
      {here.map((one) => (
        <div className={one.severity === "error" ? "sec failed" : "sec"} key={one.path + one.what + one.why}>
          <h3>
            <Icon name="error" />
            {one.path === path ? one.what : `${portOf(one.path)}: ${one.what}`}
          </h3>
          {one.why !== "" && <p style={{ margin: "4px 0" }}>{one.why}</p>}
          {one.remedy !== "" && <p className="second">{one.remedy}</p>}
        </div>
      ))}
      {error && here.length === 0 && (
        <div className="sec failed">
          <h3>
            <Icon name="error" />
            Failed{error.what ? ` in ${error.what}` : ""}
          </h3>
          <p style={{ margin: "4px 0" }}>{error.message}</p>
          {error.remedy !== "" && <p className="second">{error.remedy}</p>}
        </div>
      )}
      {(fixes.length > 0 || (error && last)) && (
        <div className="sec failed">
          <div className="remedies">
            {fixes.map((fix, index) => (
              <button type="button" className={index === 0 ? "btn primary" : "btn line"} key={fix.text} onClick={() => void ask(fix.message as Message)}>
                {fix.text}
              </button>
            ))}
            {error && last && !fixes.some((fix) => fix.message.t === "undo") && (
              <button type="button" className="btn line" onClick={() => void undo()}>
                Undo: {last.text}
              </button>
            )}
          </div>
        </div>
      )}
      {error && (
        <div className="sec">
          <h3>
            What it said
            <span className="sp" />
            <button type="button" className="btn small" onClick={() => void navigator.clipboard.writeText(error.traceback || error.message)}>
              Copy
            </button>
          </h3>
          <div className="mono said">{error.traceback || error.message}</div>
        </div>
      )}
    </>
  );
}
