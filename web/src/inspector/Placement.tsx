import { edit, locked } from "../state/actions";
import { nameOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { Fixed } from "./Fixed";
import { GateEditor } from "./GateEditor";

const NEW = " new";

/** Makes a group with one thread, in which only this node runs: code that takes long then holds nothing else up. */
async function alone(path: string, taken: string[]): Promise<void> {
  const base = nameOf(path);
  let name = base;
  for (let number = 2; taken.includes(name); number++) name = `${base}_${number}`;
  await edit([
    { do: "AddGroup", name, threads: 1 },
    { do: "Move", path, group: name },
  ]);
}

/** Where a node runs, whether it does, and what opens its gate. */
export function Placement({ path }: { path: string }) {
  const node = useStudio((s) => s.tables.nodes[path]);
  const groups = useStudio((s) => s.tables.groups);
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  const runs = useStudio((s) => !["rest", "ended"].includes(s.tables.studio.run?.state ?? "rest"));
  const off = useStudio((s) => s.age === 3) || locked() !== "";
  if (!node) return null;
  const options = Object.entries(node.options).filter(([name]) => name !== "group");
  return (
    <div className="sec">
      <h3>Where and when</h3>
      {never ? (
        <>
          <Fixed name="group" value={node.group} />
          <Fixed name="enabled" value={node.enabled ? "yes" : "no"} />
        </>
      ) : (
        <>
          <div className="par">
            <label htmlFor="group-of-node">group</label>
            <div className="fld wide">
              <select
                id="group-of-node"
                value={node.own_group ?? ""}
                disabled={off}
                onChange={(event) => void (event.target.value === NEW ? alone(path, Object.keys(groups)) : edit([{ do: "Move", path, group: event.target.value || null }]))}
              >
                <option value="">as around it ({node.group})</option>
                {Object.keys(groups).map((name) => (
                  <option key={name} value={name}>
                    {name}
                  </option>
                ))}
                <option value={NEW} disabled={runs}>
                  {runs ? "a thread of its own (stop the run first)" : "a thread of its own"}
                </option>
              </select>
            </div>
          </div>
          <div className="par">
            <label htmlFor="enabled">enabled</label>
            <input
              id="enabled"
              type="checkbox"
              checked={node.enabled}
              disabled={off}
              onChange={(event) => void edit([{ do: event.target.checked ? "Enable" : "Disable", path }])}
            />
          </div>
        </>
      )}
      <GateEditor path={path} fixed={never} />
      {options.map(([name, value]) => (
        <Fixed key={name} name={name} value={typeof value === "object" ? JSON.stringify(value) : String(value)} />
      ))}
    </div>
  );
}
