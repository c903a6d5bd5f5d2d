import { change, useStudio } from "../state/studio";
import { tell } from "../state/actions";
import { useOffers } from "../stage/offers";
import { Icon, type IconName } from "../ui/Icon";

export function Rail() {
  const panel = useStudio((s) => s.panel);
  const tab = useStudio((s) => s.tab);
  const side = useStudio((s) => s.side);
  const stage = useStudio((s) => s.stage);
  const hasViews = useOffers().views.length > 0;
  return (
    <nav id="rail" aria-label="Panels">
      <RailButton icon="tree" label="Outline (O)" on={panel === "outline"} act={() => change({ panel: panel === "outline" ? null : "outline" })} />
      <RailButton icon="states" label="States (S)" on={panel === "states"} act={() => change({ panel: panel === "states" ? null : "states" })} />
      <RailButton icon="plus" label="Add a node (Tab)" act={() => addInTheMiddle()} />
      <RailButton icon="history" label="History" on={tab === "history"} act={() => change({ tab: "history", time: true })} />
      <RailButton icon="record" label="Reset the activity" act={() => void tell("reset")} />
      {hasViews && <RailButton icon="view" label="Views (V)" on={stage} act={() => change({ stage: !stage })} />}
      <RailButton icon="eye" label="Inspector and probes (I)" on={side} act={() => change({ side: !side })} />
      <span className="spring" />
      <RailButton icon="help" label="Keys and help (?)" act={() => change({ popover: "keys" })} />
    </nav>
  );
}

function RailButton({ icon, label, on, act }: { icon: IconName; label: string; on?: boolean; act: () => void }) {
  return (
    <button type="button" className={on ? "btn sel" : "btn"} title={label} aria-label={label} aria-pressed={on} onClick={act}>
      <Icon name={icon} />
    </button>
  );
}

/** The palette without a mouse: in the middle of the canvas. */
export function addInTheMiddle(): void {
  window.dispatchEvent(new CustomEvent("hfg-add"));
}

