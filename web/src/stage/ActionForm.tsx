import { type FormEvent, useEffect, useRef, useState } from "react";
import { Field } from "../inspector/Field";
import type { ActionRecord, Data } from "../protocol/types";
import { act } from "../state/actions";
import { type Acting, change, useStudio } from "../state/studio";

/** The arguments of an action, with the same widgets as parameters. */
export function ActionForm() {
  const acting = useStudio((s) => s.acting);
  const action = useStudio((s) => s.tables.types[s.tables.nodes[acting?.path ?? ""]?.type ?? ""]?.actions.find((one) => one.name === acting?.name));
  if (!acting || !action) return null;
  return <Form key={`${acting.path}.${action.name}`} acting={acting} action={action} />;
}

function Form({ acting, action }: { acting: Acting; action: ActionRecord }) {
  const [values, setValues] = useState<Record<string, Data>>(() => Object.fromEntries(action.arguments.map((one) => [one.name, one.default])));
  const [refusal, setRefusal] = useState("");
  const root = useRef<HTMLFormElement>(null);
  useEffect(() => {
    root.current?.querySelector<HTMLElement>("input, select, button")?.focus();
  }, []);
  const close = () => change({ acting: null });
  const submit = async (event: FormEvent) => {
    event.preventDefault();
    const why = await act(acting.path, action, values);
    if (why === "") close();
    else setRefusal(why);
  };
  const left = Math.max(8, Math.min(acting.x, window.innerWidth - 336));
  const top = Math.max(8, Math.min(acting.y, window.innerHeight - 132 - 28 * action.arguments.length));
  return (
    <form
      ref={root}
      className="pop acting grows"
      role="dialog"
      aria-label={action.label}
      style={{ left, top }}
      onSubmit={(event) => void submit(event)}
      onKeyDown={(event) => {
        event.stopPropagation();
        if (event.key === "Escape") close();
      }}
    >
      <h2>{action.label}</h2>
      {action.doc !== "" && <p>{action.doc}</p>}
      {action.arguments.map((one) => (
        <Field
          key={one.name}
          id={`argument-${one.name}`}
          type={one}
          value={values[one.name] ?? null}
          locked=""
          set={async (value) => setValues((now) => ({ ...now, [one.name]: value }))}
        />
      ))}
      {refusal !== "" && (
        <p className="par-note" role="alert">
          {refusal}
        </p>
      )}
      <div className="buttons">
        <button type="button" className="btn line" onClick={close}>
          Cancel
        </button>
        <button type="submit" className="btn primary">
          {action.label}
        </button>
      </div>
    </form>
  );
}
