import { edit } from "../state/actions";
import { useStudio } from "../state/studio";
import type { Data } from "../protocol/types";
import { GateEditor } from "./GateEditor";

/** Where a node runs, whether it does, and what opens its gate. */
export function Placement({ path }: { path: string }) {
  const node = useStudio((s) => s.tables.nodes[path]);
  const groups = useStudio((s) => s.tables.groups);
  if (!node) return null;
  const options = Object.entries(node.options).filter(([name]) => name !== "group");
  return (
    <div className="sec">
      <h3>Where and when</h3>
      <div className="par">
        <label htmlFor="group-of-node">group</label>
        <div className="fld wide">
          <select
            id="group-of-node"
            value={node.own_group ?? ""}
            onChange={(event) => void edit([{ do: "Move", path, group: event.target.value || null }])}
          >
            <option value="">as around it ({node.group})</option>
            {Object.keys(groups).map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </div>
      </div>
      <div className="par">
        <label htmlFor="enabled">enabled</label>
        <input
          id="enabled"
          type="checkbox"
          checked={node.enabled}
          onChange={(event) => void edit([{ do: event.target.checked ? "Enable" : "Disable", path }])}
        />
      </div>
      <GateEditor path={path} />
      {options.map(([name, value]) => (
        <Option key={name} name={name} value={value} />
      ))}
    </div>
  );
}

function Option({ name, value }: { name: string; value: Data }) {
  return (
    <div className="par">
      <label title={name}>{name.replaceAll("_", " ")}</label>
      <span className="num" style={{ gridColumn: "2 / 4" }}>
        {typeof value === "object" ? JSON.stringify(value) : String(value)}
      </span>
    </div>
  );
}
