import { useEffect, useRef } from "react";
import { activeInside, elapsed } from "../state/looking";
import { parentOf } from "../state/paths";
import { change, studio, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { plain, unwrapped } from "../ui/paragraphs";

export function NodeHead({ path }: { path: string }) {
  const node = useStudio((s) => s.tables.nodes[path]);
  const type = useStudio((s) => s.tables.types[node?.type ?? ""]);
  const failed = useStudio((s) => s.tables.studio.run?.error?.path === path);
  const level = useStudio((s) => s.level);
  if (!node) return null;
  const around = parentOf(path);
  const where = around === "" ? "" : around === level ? around.split("/").join(" › ") : `inside ${around.split("/").join(" › ")}`;
  return (
    <div className="who">
      <div className="n">
        <h2 style={{ font: "inherit" }}>{node.name}</h2>
        <span className="sp" />
        {failed ? <span className="state bad">failed</span> : <ActiveFor path={path} />}
        <button
          type="button"
          className="btn small"
          aria-label={`More about ${node.name}`}
          onClick={(event) => {
            const box = event.currentTarget.getBoundingClientRect();
            change({ menu: { x: box.right - 224, y: box.bottom + 4, path, kind: "node" } });
          }}
        >
          <Icon name="more" />
        </button>
      </div>
      <div className="p">
        {[where, type?.title ?? node.title].filter(Boolean).join(" · ")}
        {!node.enabled && " · disabled"}
      </div>
      {node.missing !== "" ? <p style={{ color: "var(--bad)" }}>{node.missing}</p> : <p>{plain(type?.summary ?? "")}</p>}
      {type && type.doc.length > type.summary.length + 1 && <Doc text={type.doc} />}
    </div>
  );
}

function Doc({ text }: { text: string }) {
  return (
    <details>
      <summary className="muted" style={{ cursor: "pointer", marginTop: 4, fontSize: 11 }}>
        Description
      </summary>
      <p className="doc" style={{ whiteSpace: "pre-wrap" }}>
        {plain(unwrapped(text))}
      </p>
    </details>
  );
}

function ActiveFor({ path }: { path: string }) {
  const inside = useStudio((s) => (path in s.activity.since ? path : activeInside(s.activity, path)));
  const text = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    if (inside === null) return;
    const paint = () => {
      const state = studio();
      const since = state.activity.since[inside] ?? 0;
      const spent = Math.max(0, elapsed(state.tables.studio.run, state.clockOffset) - since);
      if (text.current) text.current.textContent = `active ${spent.toFixed(1)} s`;
    };
    paint();
    const timer = setInterval(paint, 250);
    return () => clearInterval(timer);
  }, [inside]);
  if (inside === null) return null;
  return <span className="state on num" ref={text} />;
}
