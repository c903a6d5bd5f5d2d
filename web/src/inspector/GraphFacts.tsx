import { groupClass } from "../state/looking";
import { useStudio } from "../state/studio";
import { plural } from "../ui/words";

/** Nothing is selected: the graph or the level itself. */
export function GraphFacts() {
  const level = useStudio((s) => s.level);
  const hello = useStudio((s) => s.hello);
  const name = useStudio((s) => s.tables.studio.file?.graph);
  const tables = useStudio((s) => s.tables);
  const inside = Object.values(tables.nodes).filter((node) => node.level === level).length;
  return (
    <>
      <div className="who">
        <h2 className="n">{level === "" ? name || "graph" : level.split("/").at(-1)}</h2>
        <div className="p">
          {plural(inside, "node")} here · {plural(Object.keys(tables.nodes).length, "node")} in all
        </div>
        {hello?.read_only ? <p>{hello.read_only}</p> : <p>Choose a node to see and change it. Tab adds one.</p>}
      </div>
      <div className="sec">
        <h3>Groups</h3>
        {Object.values(tables.groups).map((group) => (
          <div className="row" key={group.name} style={{ height: 22 }}>
            <i className={`swatch ${groupClass(tables, group.name)}`} />
            {group.name}
            <span className="muted">{group.process ? `process ${group.process}` : (group.threads ?? 0) > 0 ? plural(group.threads!, "thread") : ""}</span>
          </div>
        ))}
      </div>
    </>
  );
}
