import { tell, ask, toast } from "../state/actions";
import { useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { useState } from "react";

/** Above the canvas: the file was changed elsewhere, or edits of a studio that ended are still there. */
export function FileBar() {
  const file = useStudio((s) => s.tables.studio.file);
  const [difference, setDifference] = useState<string | null>(null);
  if (!file) return null;
  if (file.elsewhere !== "") {
    const showDifference = async () => {
      const value = await ask<string[] | string>({ t: "ask", what: "difference", args: {} });
      if (value !== null) setDifference(Array.isArray(value) ? value.join("\n") : value);
    };
    return (
      <div className="bar-above" role="alert">
        <Icon name="error" />
        <p>{file.elsewhere}</p>
        <button type="button" className="btn line" onClick={() => void tell("save", { path: "", force: true })}>
          Keep mine
        </button>
        <button type="button" className="btn line" onClick={() => void tell("reread")}>
          Take theirs
        </button>
        <button type="button" className="btn" onClick={() => void showDifference()}>
          Show the difference
        </button>
        {difference !== null && <Difference text={difference} close={() => setDifference(null)} />}
      </div>
    );
  }
  if (file.journal) {
    const when = new Date(file.journal.at * 1000).toLocaleTimeString("en", { hour: "2-digit", minute: "2-digit", hour12: false });
    const changes = file.journal.changes === 1 ? "is 1 change that was" : `are ${file.journal.changes} changes that were`;
    const answer = async (take: boolean) => {
      if ((await tell("journal", { take })) !== null) toast(take ? "Taken up; undo takes them back." : "Dropped.", {}, 2000);
    };
    return (
      <div className="bar-above" role="alert">
        <Icon name="history" />
        <p>
          There {changes} not saved when the studio ended at {when}. Take them up?
        </p>
        <button type="button" className="btn line" onClick={() => void answer(true)}>
          Take them up
        </button>
        <button type="button" className="btn" onClick={() => void answer(false)}>
          Drop them
        </button>
      </div>
    );
  }
  return null;
}

function Difference({ text, close }: { text: string; close: () => void }) {
  return (
    <div className="veil" onClick={close}>
      <div className="pop dialog" role="dialog" aria-label="Difference of the file" style={{ width: 720 }}>
        <h2>On the disk, and here</h2>
        <pre className="said mono" style={{ maxHeight: 400, overflow: "auto" }}>
          {text || "No difference."}
        </pre>
      </div>
    </div>
  );
}
