import { useEffect, useState } from "react";
import { ask, question, save, tell, toast } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";

interface Folder {
  path: string;
  folders: string[];
  files: { name: string; kind: string }[];
}

/** Files of the given folder, and no others. */
export function OpenFile() {
  const file = useStudio((s) => s.tables.studio.file);
  const [folder, setFolder] = useState<Folder | null>(null);
  const [name, setName] = useState(file?.kind === "yaml" ? file.name : "");
  const close = () => change({ popover: null });
  const look = (path: string) => {
    question<Folder>("folder", { path }).then(setFolder, (error: Error) => toast(error.message, { kind: "bad" }));
  };
  useEffect(() => look(""), []);
  const inside = (one: string) => (folder?.path ? `${folder.path}/${one}` : one);
  const open = async (path: string) => {
    const lost = (file?.changes ?? 0) > 0;
    if (lost && !window.confirm(`${file!.changes} changes of ${file!.name} are not saved. Open ${path} and lose them?`)) return;
    if ((await ask({ t: "open", path, discard: lost })) !== null) close();
  };
  return (
    <div className="veil" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop dialog grows" role="dialog" aria-label="Open or save">
        <h2>Files in {file?.folder ?? "the folder"}</h2>
        <ul className="list" style={{ maxHeight: 280, overflow: "auto" }}>
          {folder?.path && (
            <li>
              <button type="button" className="btn" onClick={() => look(folder.path.split("/").slice(0, -1).join("/"))}>
                up
              </button>
            </li>
          )}
          {folder?.folders.map((one) => (
            <li key={one}>
              <button type="button" className="btn" onClick={() => look(inside(one))}>
                {one}/
              </button>
            </li>
          ))}
          {folder?.files.map((one) => (
            <li key={one.name}>
              <button type="button" className="btn" onClick={() => void open(inside(one.name))}>
                <Icon name="file" /> {one.name}
              </button>
              <span className="muted">{one.kind}</span>
            </li>
          ))}
        </ul>
        <label htmlFor="save-as">Save as</label>
        <div className="fld">
          <input id="save-as" autoFocus value={name} onKeyDown={(event) => event.key === "Enter" && name !== "" && void save(inside(named(name))).then((done) => done && close())} placeholder="name.hfg.yaml" onChange={(event) => setName(event.target.value)} />
        </div>
        <div className="actions">
          <button type="button" className="btn line" onClick={() => void tell("open", { path: "", discard: false }).then(close)}>
            New graph
          </button>
          <span className="spring" />
          <button type="button" className="btn" onClick={close}>
            Leave
          </button>
          <button type="button" className="btn primary" disabled={name === ""} onClick={() => void save(inside(named(name))).then((done) => done && close())}>
            Save
          </button>
        </div>
      </div>
    </div>
  );
}

const SUFFIX = ".hfg.yaml";
const named = (name: string): string => (name.endsWith(SUFFIX) ? name : `${name}${SUFFIX}`);
