import { useState } from "react";
import { Refusal } from "../protocol/socket";
import type { Data } from "../protocol/types";
import { locked, newGesture } from "../state/actions";
import { useAnswer } from "../state/useAnswer";
import { Icon } from "../ui/Icon";
import { Anew } from "./Field";
import { short } from "../ui/words";

interface Given {
  name: string;
  kind: string;
  required: boolean;
  default: Data;
}

interface Known {
  reference: string;
  name: string;
  summary: string;
  parameters: Given[];
}

interface Said {
  type: string;
  arguments?: Data[];
  parameters?: Record<string, Data>;
}

interface Props {
  option: { doc: string; value: Data; why: string };
  set: (value: Data, gesture: string) => Promise<unknown>;
  anew?: ((value: Data) => Promise<unknown>) | undefined;
}

/** What signals go through before they are queued, in order. */
export function Operators({ option, set, anew }: Props) {
  const known = useAnswer<Known[]>("operators", {}) ?? [];
  const [refusal, setRefusal] = useState("");
  const [adding, setAdding] = useState<Known | null>(null);
  const said = (Array.isArray(option.value) ? option.value : []) as unknown as Said[];
  const off = option.why !== "" || locked() !== "";
  const [refused, setRefused] = useState<Said[]>([]);
  const settle = () => {
    setRefusal("");
    setAdding(null);
  };
  const send = (next: Said[]) =>
    set(next as unknown as Data, newGesture()).then(settle, (error: Error) => {
      setRefusal(error instanceof Refusal ? error.reject.message : error.message);
      setRefused(next);
    });
  return (
    <>
      <div className="par" title={option.doc}>
        <label htmlFor="add-operator">operators</label>
        <div className="fld wide">
          <select
            id="add-operator"
            value=""
            disabled={off}
            onChange={(event) => {
              const one = known.find((each) => each.reference === event.target.value) ?? null;
              if (one?.parameters.length === 0) void send([...said, { type: one.reference }]);
              else setAdding(one);
            }}
          >
            <option value="">{said.length === 0 ? "none; add one" : "add one"}</option>
            {known.map((one) => (
              <option key={one.reference} value={one.reference} title={one.summary}>
                {one.name}
              </option>
            ))}
          </select>
        </div>
      </div>
      {said.map((one, at) => (
        <div className="op-row num" key={`${at}-${one.type}`}>
          <span title={one.type}>{inWords(one)}</span>
          <button type="button" className="btn small" disabled={off} aria-label={`Take ${nameOf(one)} away`} onClick={() => void send(said.filter((_, other) => other !== at))}>
            <Icon name="close" />
          </button>
        </div>
      ))}
      {adding && <Adding key={adding.reference} operator={adding} add={(one) => void send([...said, one])} leave={() => setAdding(null)} />}
      {option.why !== "" && <p className="par-note muted">{option.why}</p>}
      {refusal !== "" && (
        <p className="par-note" role="alert">
          {refusal}
          {anew && <Anew act={() => void anew(refused as unknown as Data).then(settle)} />}
        </p>
      )}
    </>
  );
}

const nameOf = (one: Said): string => one.type.split(":").at(-1) ?? one.type;

function inWords(one: Said): string {
  const named = Object.entries(one.parameters ?? {}).map(([name, value]) => `${name} ${short(value)}`);
  return [nameOf(one), ...(one.arguments ?? []).map(short), ...named].join(" ");
}

/** What a new operator is given. */
function Adding({ operator, add, leave }: { operator: Known; add: (one: Said) => void; leave: () => void }) {
  const [texts, setTexts] = useState<Record<string, string>>({});
  const done = () => {
    const given = operator.parameters.filter((one) => (texts[one.name] ?? "").trim() !== "");
    add({ type: operator.reference, parameters: Object.fromEntries(given.map((one) => [one.name, valueOf(one, texts[one.name] ?? "")])) });
  };
  return (
    <form
      className="op-form"
      onSubmit={(event) => {
        event.preventDefault();
        done();
      }}
    >
      <p className="second">{operator.summary}</p>
      {operator.parameters.map((one, at) => (
        <div className="par" key={one.name}>
          <label htmlFor={`operator-${one.name}`}>{one.name.replaceAll("_", " ")}</label>
          <div className="fld wide">
            <input
              id={`operator-${one.name}`}
              autoFocus={at === 0}
              placeholder={one.required ? "needed" : short(one.default)}
              onChange={(event) => setTexts({ ...texts, [one.name]: event.target.value })}
            />
          </div>
        </div>
      ))}
      <div className="remedies">
        <button type="submit" className="btn primary">
          Add {operator.name}
        </button>
        <button type="button" className="btn line" onClick={leave}>
          Leave
        </button>
      </div>
    </form>
  );
}

function valueOf(one: Given, text: string): Data {
  if (one.kind === "text") return text;
  try {
    return JSON.parse(text) as Data;
  } catch {
    return text;
  }
}
