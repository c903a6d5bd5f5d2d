import { useStudio } from "../state/studio";
import { Divider } from "../shell/Divider";
import { EdgeFacts } from "./EdgeFacts";
import { FailedSection } from "./FailedSection";
import { GraphFacts } from "./GraphFacts";
import { Measured } from "./Measured";
import { NodeHead } from "./NodeHead";
import { Parameters } from "./Parameters";
import { Placement } from "./Placement";
import { Several } from "./Several";
import { Ports } from "./Ports";
import { Promotions } from "./Promotions";
import { StopEditor } from "./StopEditor";
import { Probes } from "../probes/Probes";

/** Whatever is selected, with all that can be seen and changed about it. */
export function Inspector() {
  const only = useStudio((s) => (s.selection.size === 1 ? [...s.selection][0]! : null));
  const edge = useStudio((s) => s.selectedEdge);
  const several = useStudio((s) => s.selection.size);
  const exists = useStudio((s) => only !== null && only in s.tables.nodes);
  return (
    <aside id="side" aria-label="Inspector">
      <Divider way="v" variable="--side" usual={320} least={240} most={640} label="Width of the inspector" />
      <div className="scroll" tabIndex={0} role="region" aria-label="Facts of the selection">
        {exists && only !== null ? (
          <OfNode path={only} />
        ) : edge !== null ? (
          <EdgeFacts edge={edge} />
        ) : several > 1 ? (
          <Several count={several} />
        ) : (
          <GraphFacts />
        )}
        <Probes />
      </div>
    </aside>
  );
}

function OfNode({ path }: { path: string }) {
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  return (
    <>
      <NodeHead path={path} />
      <FailedSection path={path} />
      <Parameters key={path} path={path} />
      <Measured path={path} />
      <Ports path={path} />
      <Placement path={path} />
      {!never && <Promotions path={path} />}
      {!never && <StopEditor path={path} />}
    </>
  );
}
