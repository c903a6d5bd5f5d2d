import type { Command, Data, ParameterType } from "../protocol/types";
import { edit } from "../state/actions";
import { socket } from "../state/link";
import { endsOf } from "../state/paths";
import { useStudio } from "../state/studio";
import { useAnswer } from "../state/useAnswer";
import { Field } from "./Field";
import { Operators } from "./Operators";

type Option = ParameterType & { value: Data; why: string };

/** What an edge can be told: queue, initial tokens, operators; the studio says which of them it has. */
export function EdgeOptions({ edge }: { edge: string }) {
  const found = useAnswer<{ options: Option[]; anew: Command[] }>("edge", { path: edge });
  const [source, target] = endsOf(edge);
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  const set = (name: string) => (value: Data, gesture: string) =>
    socket.request({ t: "edit", commands: [{ do: "SetEdge", source, target, [name]: value }], gesture });
  const anew = (name: string) => {
    if (!found || found.anew.length === 0) return undefined;
    return (value: Data) => edit(found.anew.map((one) => (one.do === "Connect" ? { ...one, [name]: value } : one)));
  };
  return (
    <div className="sec">
      <h3>
        Settings<span className="sp" />
        <small>{never ? "" : "change at once, undoable"}</small>
      </h3>
      {(found?.options ?? []).map((one) =>
        one.kind === "operators" ? (
          <Operators key={one.name} option={one} set={set(one.name)} anew={anew(one.name)} />
        ) : (
          <Field key={one.name} id={`edge-${one.name}`} type={one} value={one.value} locked={one.why} set={set(one.name)} anew={anew(one.name)} />
        ),
      )}
    </div>
  );
}
