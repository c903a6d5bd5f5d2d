import { useEffect, useState } from "react";
import { openFile, question, save, tell, toast } from "../state/actions";
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
  const several = useStudio((s) => s.several);
  const close = () => change({ popover: null });
  const look = (path: string) => {
    question<Folder>("folder", { path }).then(setFolder, (error: Error) => toast(error.message, { kind: "bad" }));
  };
  useEffect(() => {
    look("");
    return () => change({ several: null });
  }, []);
  const inside = (one: string) => (folder?.path ? `${folder.path}/${one}` : one);
  const open = async (path: string) => {
    const lost = (file?.changes ?? 0) > 0;
    if (lost && !window.confirm(`${file!.changes} changes of ${file!.name} are not saved. Open ${path} and lose them?`)) return;
    await openFile(path, lost);
  };
  return (
    <div className="veil" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop dialog grows" role="dialog" aria-label="Open or save">
        <h2>{several ? `Graphs in ${several.path}` : `Files in ${file?.folder ?? "the folder"}`}</h2>
        {several ? (
          <ul className="list">
            <Row label="back" onClick={() => change({ several: null })} />
            {several.names.map((one) => (
              <Row key={one} label={one} icon="file" onClick={() => void open(`${several.path}:${one}`)} />
            ))}
          </ul>
        ) : (
          <ul className="list">
            {folder?.path && <Row label="up" onClick={() => look(folder.path.split("/").slice(0, -1).join("/"))} />}
            {folder?.folders.map((one) => (
              <Row key={one} label={`${one}/`} onClick={() => look(inside(one))} />
            ))}
            {folder?.files.map((one) => (
              <Row key={one.name} label={one.name} icon="file" kind={one.kind} onClick={() => void open(inside(one.name))} />
            ))}
          </ul>
        )}
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

function Row({ label, icon, kind, onClick }: { label: string; icon?: "file"; kind?: string; onClick: () => void }) {
  return (
    <li>
      <button type="button" className="btn" onClick={onClick}>
        {icon && <Icon name={icon} />} {label}
      </button>
      {kind && <span className="muted">{kind}</span>}
    </li>
  );
}

const SUFFIX = ".hfg.yaml";
const named = (name: string): string => (name.endsWith(SUFFIX) ? name : `${name}${SUFFIX}`);
