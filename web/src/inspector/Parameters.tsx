import { useStudio } from "../state/studio";
import { isRecording, limitOf } from "../state/looking";
import type { ParameterType } from "../protocol/types";
import { Parameter } from "./Parameter";
import { ActiveLimit } from "./ActiveLimit";

export function Parameters({ path }: { path: string }) {
  const node = useStudio((s) => s.tables.nodes[path]);
  const type = useStudio((s) => s.tables.types[node?.type ?? ""]);
  const recording = useStudio((s) => isRecording(s.tables.studio.run));
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  const limit = limitOf(node);
  if (!node) return null;
  const shown = (type?.parameters ?? []).filter((one) => node.shown.includes(one.name));
  if (shown.length === 0 && limit === null) return null;
  const groups = new Map<string, ParameterType[]>();
  for (const one of shown) groups.set(one.group || "", [...(groups.get(one.group || "") ?? []), one]);
  return (
    <div className="sec">
      <h3>
        Parameters<span className="sp" />
        <small>{recording ? "at the cursor" : never ? "" : "change at once, undoable"}</small>
      </h3>
      {[...groups].map(([group, members]) => (
        <div key={group}>
          {group !== "" && <p className="muted">{group}</p>}
          {members.map((one) => (
            <Parameter
              key={one.name}
              path={`${path}.${one.name}`}
              type={one}
              value={node.parameters[one.name] ?? one.default}
              locked={node.locked[one.name] ?? ""}
            />
          ))}
        </div>
      ))}
      {limit !== null && <ActiveLimit path={path} limit={limit} />}
    </div>
  );
}

