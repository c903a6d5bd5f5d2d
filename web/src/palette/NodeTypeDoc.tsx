import { useEffect, useState } from "react";
import type { FoundRow, TypeRecord } from "../protocol/types";
import { question } from "../state/actions";
import { short } from "../ui/words";

const known = new Map<string, TypeRecord>();

/** What a node type is for, its ports and its parameters. */
export function NodeTypeDoc({ row, port }: { row: FoundRow; port: string }) {
  const [type, setType] = useState<TypeRecord | null>(known.get(row.reference) ?? null);
  useEffect(() => {
    let gone = false;
    setType(known.get(row.reference) ?? null);
    question<TypeRecord>("type", { reference: row.reference }).then(
      (one) => {
        known.set(row.reference, one);
        if (!gone) setType(one);
      },
      () => undefined,
    );
    return () => {
      gone = true;
    };
  }, [row.reference]);
  return (
    <>
      <h4>{row.name || row.title}</h4>
      <p>{row.summary}</p>
      {type && (
        <>
          {Object.entries(type.ports).map(([name, says]) => (
            <div className="prt" key={name} style={{ gridTemplateColumns: "12px minmax(0, 1fr) auto" }}>
              <i className={/^(slot|event)/.test(name) ? "ci" : "sq"} />
              <span>
                {name.slice(name.indexOf("/") + 1)}
                <em>{says}</em>
              </span>
              <span className="v" style={{ color: "var(--you)" }}>
                {port !== "" && row.fit !== "refused" && row.port.endsWith(name.slice(name.indexOf("/") + 1)) ? "connects" : ""}
              </span>
            </div>
          ))}
          <dl className="given">
            {type.parameters.map((one) => (
              <div key={one.name} title={one.doc}>
                <dt>{one.name}</dt>
                <dd className="num">
                  {one.required ? "needed" : short(one.default)} {one.unit}
                </dd>
              </div>
            ))}
          </dl>
          {type.doc.length > type.summary.length + 1 && <p style={{ whiteSpace: "pre-wrap", marginTop: 8 }}>{type.doc.slice(type.summary.length).trim()}</p>}
        </>
      )}
    </>
  );
}
