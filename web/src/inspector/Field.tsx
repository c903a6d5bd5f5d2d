import { useState } from "react";
import { Refusal } from "../protocol/socket";
import type { Data, ParameterType } from "../protocol/types";
import { locked as lockedNow, newGesture } from "../state/actions";
import { useStudio } from "../state/studio";
import { said, short } from "../ui/words";
import { Fixed } from "./Fixed";
import { Choice } from "./widgets/Choice";
import { Choices } from "./widgets/Choices";
import { Colour } from "./widgets/Colour";
import { Numbers } from "./widgets/Numbers";
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
  id: string;
  type: ParameterType;
  value: Data;
  /** Why it cannot be set; "" if it can. */
  locked: string;
  set: (value: Data, gesture: string) => Promise<unknown>;
  /** Does it in another way, which loses something; offered once it was refused. */
  anew?: ((value: Data) => Promise<unknown>) | undefined;
}

/** A value with a name: the widget for its kind, and the studio's sentence when it refuses another. */
export function Field({ id, type, value, locked, set, anew }: Props) {
  const [refusal, setRefusal] = useState("");
  const [refused, setRefused] = useState<Data>(null);
  /** What the person has set, until the studio has answered: who goes on at once goes on from there. */
  const [asked, setAsked] = useState<{ value: Data } | null>(null);
  const old = useStudio((s) => s.age === 3);
  const shown = asked ? asked.value : value;
  const changed = JSON.stringify(shown) !== JSON.stringify(type.default);
  const off = locked !== "" || type.read_only || old || lockedNow() !== "";
  const send = (next: Data, gesture: string) => {
    const mine = { value: next };
    setAsked(mine);
    void set(next, gesture)
      .then(
        () => setRefusal(""),
        (error: Error) => {
          setRefusal(error instanceof Refusal ? `${error.reject.message}` : error.message);
          setRefused(next);
        },
      )
      .then(() => setAsked((now) => (now === mine ? null : now)));
  };
  const never = useStudio((s) => (s.hello?.read_only ?? "") !== "");
  const Widget = widgetFor(type);
  const help = [type.doc, locked, changed && `usually ${short(type.default)}; double click resets it`];
  if (never) return <Fixed name={type.name} value={`${said(value)}${type.unit ? ` ${type.unit}` : ""}`} title={type.doc} />;
  return (
    <>
      <div className={changed ? "par ch" : "par"} title={help.filter(Boolean).join("\n")}>
        <label htmlFor={id} onDoubleClick={() => changed && !off && send(type.default, newGesture())}>
          {type.name.replaceAll("_", " ")}
        </label>
        <Widget id={id} type={type} value={shown} off={off} bad={refusal !== ""} set={send} />
      </div>
      {refusal !== "" && (
        <p className="par-note" role="alert">
          {refusal}. It stays at {short(value)}
          {type.unit ? ` ${type.unit}` : ""}.
          {anew && <Anew act={() => void anew(refused).then(() => setRefusal(""))} />}
        </p>
      )}
      {locked !== "" && <p className="par-note muted">{locked}</p>}
    </>
  );
}

export function Anew({ act }: { act: () => void }) {
  return (
    <button type="button" className="btn line anew" onClick={act}>
      Replace the edge, without what lies on it
    </button>
  );
}

function widgetFor(type: ParameterType): (props: WidgetProps) => React.ReactNode {
  switch (type.kind) {
    case "int":
    case "float":
      return Slider;
    case "bool":
      return type.optional ? Choice : Switch;
    case "choice":
      return Choice;
    case "choices":
      return Choices;
    case "interval":
    case "vector":
      return Numbers;
    case "colour":
      return Colour;
    case "text":
    case "path":
      return TextField;
    default:
      return Plain;
  }
}
