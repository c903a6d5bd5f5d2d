import { useEffect } from "react";
import { dropToast, show, toast } from "../state/actions";
import { useStudio } from "../state/studio";
import { moment } from "../ui/words";

/** A failure is said once, and stays in the list of problems. */
export function useFailures(): void {
  const run = useStudio((s) => s.tables.studio.run);
  const error = run?.error ?? null;
  const number = run?.number ?? 0;
  useEffect(() => {
    if (error === null || run === undefined) return;
    const action = error.path ? { action: { label: "Show node", act: () => show(error.path) } } : {};
    const title = run.state === "ended" ? `The run has failed at ${moment(run.elapsed_s)}.` : `${error.path} has failed.`;
    const said = toast(error.message, { kind: "bad", title, ...action }, 0);
    return () => dropToast(said); // with the next run it is of the past
    // Only a new failure counts, not each new record of the same run.
  }, [error?.message, number]);
}
