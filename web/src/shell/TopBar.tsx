import { choose, enter, locked, redo, undo } from "../state/actions";
import { layoutKey, change, useStudio, type View } from "../state/studio";
import { isStart } from "../state/looking";
import { nameOf } from "../state/paths";
import { useOffers } from "../stage/offers";
import { Icon } from "../ui/Icon";
import { Clock } from "./Clock";
import { RunControl } from "./RunControl";

export function TopBar() {
  const start = useStudio(isStart);
  return (
    <header id="top">
      <Logo />
      <Crumbs />
      <FileName />
      <span className="spring" />
      {!start && (
        <>
          <RunControl />
          <Clock />
          <ActionsButton />
          <span className="spring" />
          <ViewSwitch />
        </>
      )}
      <button type="button" className="find" aria-label="Find or do anything" onClick={() => change({ popover: "commands" })}>
        <Icon name="find" />
        <span>Find or do anything</span>
        <span className="spring" />
        <kbd>Ctrl K</kbd>
      </button>
      <UndoButtons />
      <ThemeButton />
    </header>
  );
}

/** What nodes offer to do, in a menu; not there if no node offers anything. */
function ActionsButton() {
  const { actions } = useOffers();
  const open = useStudio((s) => s.popover === "actions");
  useStudio((s) => s.age === 3); // it locks with the edits
  if (actions.length === 0) return null;
  const why = locked();
  return (
    <button
      type="button"
      className="btn line actions-button"
      title={why || "What one can do to the nodes (X)"}
      aria-haspopup="menu"
      aria-expanded={open}
      disabled={why !== ""}
      onClick={() => change({ popover: open ? null : "actions" })}
    >
      <Icon name="bolt" />
      <span className="hide-n">Actions</span>
    </button>
  );
}

/** Its line is orange while anything is active: orange means nothing else, here too. */
function Logo() {
  const active = useStudio((s) => Object.keys(s.activity.since).length > 0);
  return (
    <div className="logo" title="hfg studio">
      <svg width="20" height="20" viewBox="0 0 20 20" aria-hidden="true">
        <rect x="1" y="7" width="6" height="6" fill="var(--ink)" />
        <path d="M7 9h6M7 11h6" stroke={active ? "var(--on)" : "var(--edge-soft)"} strokeWidth="1.6" />
        <circle cx="16" cy="10" r="3" fill="none" stroke="var(--ink)" strokeWidth="1.8" />
      </svg>
    </div>
  );
}

/** Where I am; a dot says that there is activity inside. */
function Crumbs() {
  const level = useStudio((s) => s.level);
  const name = useStudio((s) => (isStart(s) ? "no graph" : (s.tables.studio.file?.graph ?? "")));
  const since = useStudio((s) => s.activity.since);
  const parts = level === "" ? [] : level.split("/");
  const levels = ["", ...parts.map((_, index) => parts.slice(0, index + 1).join("/"))];
  return (
    <nav className="crumbs" aria-label="Where you are">
      {levels.map((path) => {
        const active = path !== "" && Object.keys(since).some((one) => one === path || one.startsWith(`${path}/`));
        const classes = [path === level && "here", active && "on"].filter(Boolean).join(" ");
        return (
          <span key={path}>
            {path !== "" && <i>›</i>}
            <button type="button" className={classes} aria-current={path === level ? "page" : undefined} onClick={() => enter(path)}>
              {path === "" ? name || "graph" : nameOf(path)}
            </button>
          </span>
        );
      })}
    </nav>
  );
}

function FileName() {
  const file = useStudio((s) => s.tables.studio.file);
  if (!file || file.kind === "none") return null;
  const changes = file.changes;
  return (
    <span className="filename num hide-n" title={file.kind === "recording" ? "a recording, which does not change" : changes > 0 ? `${changes} not saved (Ctrl+S)` : "saved"}>
      {file.name}
      {changes > 0 && (
        <>
          {" "}
          <b>•</b> {changes === 1 ? "1 change" : `${changes} changes`}
        </>
      )}
    </span>
  );
}

const VIEWS: [View, string, string][] = [
  ["activity", "Activity", "1"],
  ["mission", "Mission", "2"],
  ["all", "All edges", "3"],
];

function ViewSwitch() {
  const view = useStudio((s) => s.views[s.level] ?? s.tables.layouts[layoutKey(s)]?.view ?? "all");
  return (
    <span className="group hide-n" role="group" aria-label="What edges are shown">
      {VIEWS.map(([key, label, shortcut]) => (
        <button
          key={key}
          type="button"
          className={view === key ? "btn sel" : "btn"}
          aria-pressed={view === key}
          title={`${label} (${shortcut})`}
          onClick={() => choose(key)}
        >
          {label}
        </button>
      ))}
    </span>
  );
}

function UndoButtons() {
  const done = useStudio((s) => s.tables.studio.history?.done.at(-1));
  const undone = useStudio((s) => s.tables.studio.history?.undone.at(-1));
  const undoing = done ? `Undo: ${done.text} (Ctrl+Z)` : "Nothing to undo";
  const redoing = undone ? `Redo: ${undone.text} (Ctrl+Shift+Z)` : "Nothing to redo";
  return (
    <>
      <button type="button" className="btn" title={undoing} aria-label={undoing} disabled={!done} onClick={() => void undo()}>
        <Icon name="undo" />
      </button>
      <button type="button" className="btn hide-n" title={redoing} aria-label={redoing} disabled={!undone} onClick={() => void redo()}>
        <Icon name="redo" />
      </button>
    </>
  );
}

function ThemeButton() {
  const theme = useStudio((s) => s.theme);
  const other = theme === "dark" ? "light" : "dark";
  return (
    <button type="button" className="btn" title="Light or dark" aria-label={`Show the ${other} theme`} onClick={() => change({ theme: other })}>
      <Icon name="sun" />
    </button>
  );
}
