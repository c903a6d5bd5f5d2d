import { Divider } from "../shell/Divider";
import { change, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { firstViews, type OfferedView } from "./offered";
import { useOffers } from "./offers";
import { SceneView } from "./SceneView";

/** Views that nodes offer, beside the graph: as many as one likes, below each other. */
export function Stage() {
  const { views } = useOffers();
  const chosen = useStudio((s) => s.views_shown);
  const known = new Map(views.map((one) => [one.key, one]));
  const shown = (chosen ?? firstViews(views)).filter((key) => known.has(key));
  const left = views.filter((one) => !shown.includes(one.key));
  const set = (keys: string[]) => change({ views_shown: keys, stage: keys.length > 0 });
  return (
    <section id="stage" aria-label="Views of nodes">
      <Divider way="v" variable="--stage" usual={368} least={240} most={800} label="Width of the views" before />
      <div className="scroll">
        {shown.map((key, index) => (
          <OneView
            key={key}
            view={known.get(key)!}
            others={left}
            choose={(other) => set(shown.map((one, at) => (at === index ? other : one)))}
            close={() => set(shown.filter((one) => one !== key))}
          />
        ))}
        {left.length > 0 && (
          <button type="button" className="btn small line more-views" onClick={() => set([...shown, left[0]!.key])}>
            <Icon name="plus" /> One more view
          </button>
        )}
      </div>
    </section>
  );
}

interface Props {
  view: OfferedView;
  others: OfferedView[];
  choose: (key: string) => void;
  close: () => void;
}

function OneView({ view, others, choose, close }: Props) {
  return (
    <div className="view">
      <header title={view.doc}>
        <select aria-label="What this view shows" value={view.key} onChange={(event) => choose(event.target.value)}>
          {[view, ...others].map((one) => (
            <option key={one.key} value={one.key}>
              {one.title} · {one.path}
            </option>
          ))}
        </select>
        <button type="button" className="btn small" aria-label={`Close ${view.title}`} onClick={close}>
          <Icon name="close" />
        </button>
      </header>
      <SceneView view={view} />
    </div>
  );
}
