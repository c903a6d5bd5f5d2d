import { useState } from "react";
import { Refusal } from "../protocol/socket";
import type { Data, ParameterType } from "../protocol/types";
import { locked as lockedNow, newGesture } from "../state/actions";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";
import { short } from "../ui/words";
import { Choice } from "./widgets/Choice";
import { Colour } from "./widgets/Colour";
import { Plain } from "./widgets/Plain";
import { Slider } from "./widgets/Slider";
import { Switch } from "./widgets/Switch";
import { TextField } from "./widgets/TextField";

export interface WidgetProps {
  id: string;
  type: ParameterType;
  value: Data;
  off: boolean;
  bad: boolean;
  set: (value: Data, gesture: string) => void;
}

interface Props {
  path: string;
  type: ParameterType;
  value: Data;
  locked: string;
}

/** One parameter: its name, the widget for its kind, and the studio's sentence when it refuses a value. */
export function Parameter({ path, type, value, locked }: Props) {
  const [refusal, setRefusal] = useState("");
  const old = useStudio((s) => s.age === 3);
  const changed = JSON.stringify(value) !== JSON.stringify(type.default);
  const off = locked !== "" || type.read_only || old || lockedNow() !== "";
  const set = (next: Data, gesture: string) => {
    socket.request({ t: "edit", commands: [{ do: "SetParameter", path, value: next }], gesture }).then(
      () => setRefusal(""),
      (error: Error) => setRefusal(error instanceof Refusal ? `${error.reject.message}` : error.message),
    );
  };
  const Widget = widgetFor(type);
  const id = `parameter-${path}`;
  const help = [type.doc, locked && `given by ${locked}`, changed && `usually ${short(type.default)}; double click resets it`];
  return (
    <>
      <div className={changed ? "par ch" : "par"} title={help.filter(Boolean).join("\n")}>
        <label htmlFor={id} onDoubleClick={() => changed && !off && set(type.default, newGesture())}>
          {type.name}
        </label>
        <Widget id={id} type={type} value={value} off={off} bad={refusal !== ""} set={set} />
      </div>
      {refusal !== "" && (
        <p className="par-note" role="alert">
          {refusal} It stays at {short(value)}
          {type.unit ? ` ${type.unit}` : ""}.
        </p>
      )}
      {locked !== "" && <p className="par-note muted">given by {locked.split(" -> ")[0]}</p>}
    </>
  );
}

function widgetFor(type: ParameterType): (props: WidgetProps) => React.ReactNode {
  switch (type.kind) {
    case "int":
    case "float":
      return Slider;
    case "switch":
      return Switch;
    case "choice":
      return Choice;
    case "colour":
      return Colour;
    case "text":
    case "path":
      return TextField;
    default:
      return Plain;
  }
}
