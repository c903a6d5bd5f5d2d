import { useWaits } from "../live/waits";
import { rename } from "../state/actions";
import { change, useStudio } from "../state/studio";
import type { NodeBox, NodeRecord } from "../protocol/types";
import { Icon } from "../ui/Icon";

interface Props {
  box: NodeBox;
  record: NodeRecord | undefined;
  top: number;
  plain: boolean;
}

/** Name and badges: facts of one node are marks on it, never edges. */
export function NodeTitle({ box, record, top, plain }: Props) {
  const renaming = useStudio((s) => s.renaming === box.id);
  const style = plain ? { top, left: 8, justifyContent: "center" } : { top };
  return (
    <div className="t" style={style}>
      {renaming ? <NameField path={box.id} name={box.name} /> : <b>{box.name}</b>}
      {!plain && (
        <>
          <span className="sp" />
          <WaitBadge path={box.id} />
          {box.badges.map((badge) =>
            badge.kind === "gate" ? (
              <GateBadge key={`g${badge.by}${badge.says}`} says={badge.says} by={badge.by || box.id} own={badge.says === ""} />
            ) : (
              <span key={`t${badge.says}`} className="badge" title={`hands the activity on after ${badge.says}`}>
                <Icon name="clock" /> {badge.says}
              </span>
            ),
          )}
          {box.kind === "subgraph" && !box.is_open && (
            <span className="badge num" title={`subgraph of ${box.inner} nodes; double click to enter`}>
              {record?.inside ?? box.inner}
              <Icon name="enter" />
            </span>
          )}
        </>
      )}
    </div>
  );
}

/** A node that has stood still for a second: what it waits for. */
function WaitBadge({ path }: { path: string }) {
  const says = useWaits((s) => s.nodes[path]?.[0]);
  if (says === undefined) return null;
  return (
    <span className="badge waits" title={says} aria-label={says} role="img">
      <Icon name="hourglass" />
    </span>
  );
}

function GateBadge({ says, by, own }: { says: string; by: string; own: boolean }) {
  const open = useStudio((s) => by in s.activity.since || Object.keys(s.activity.since).some((p) => p.startsWith(`${by}/`)));
  const title = own ? "works only while it is active" : `works only while ${says} is active`;
  return (
    <span className={open ? "badge on" : "badge"} title={title}>
      <Icon name="gate" />
      {says}
    </span>
  );
}

function NameField({ path, name }: { path: string; name: string }) {
  return (
    <input
      className="nodrag nopan"
      defaultValue={name}
      aria-label="Name of the node"
      autoFocus
      onFocus={(event) => event.target.select()}
      onKeyDown={(event) => {
        event.stopPropagation();
        if (event.key === "Enter") void rename(path, event.currentTarget.value.trim());
        if (event.key === "Escape") change({ renaming: null });
      }}
      onBlur={(event) => void rename(path, event.target.value.trim())}
    />
  );
}
