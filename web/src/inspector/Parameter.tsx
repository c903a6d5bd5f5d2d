import type { Data, ParameterType } from "../protocol/types";
import { socket } from "../state/link";
import { Field } from "./Field";

interface Props {
  path: string;
  type: ParameterType;
  value: Data;
  locked: string;
}

/** One parameter of a node. */
export function Parameter({ path, type, value, locked }: Props) {
  const set = (next: Data, gesture: string) => socket.request({ t: "edit", commands: [{ do: "SetParameter", path, value: next }], gesture });
  const why = locked === "" ? "" : `given by ${locked.split(" -> ")[0]}`;
  return <Field id={`parameter-${path}`} type={type} value={value} locked={why} set={set} />;
}
