import { ALIGNMENTS, DOINGS } from "../keys/commands";

const ORDER = [...ALIGNMENTS.map(([, name]) => name), "Distribute from left to right", "Distribute from top to bottom"];
const OTHERS = ["Frame the selection", "Make a subgraph of the selection", "Enable or disable", "Lay out the selection"];

/** Several nodes are selected: what one can do with all of them. */
export function Several({ count }: { count: number }) {
  return (
    <>
      <div className="who">
        <h2 className="n">{count} nodes</h2>
      </div>
      <Doings title="Order" names={ORDER} />
      <Doings title="With all of them" names={OTHERS} />
    </>
  );
}

function Doings({ title, names }: { title: string; names: string[] }) {
  return (
    <div className="sec">
      <h3>{title}</h3>
      <div className="remedies">
        {names.map((name) => {
          const doing = DOINGS.find((one) => one.name === name)!;
          const why = doing.off?.() ?? "";
          return (
            <button key={name} type="button" className="btn line" disabled={why !== ""} title={why || undefined} onClick={doing.run}>
              {name} {doing.keys !== "" && <kbd>{doing.keys.replaceAll("+", " ")}</kbd>}
            </button>
          );
        })}
      </div>
    </div>
  );
}
