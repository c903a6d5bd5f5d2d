import { useEffect, useState } from "react";
import type { FoundRow, TypeRecord } from "../protocol/types";
import { question } from "../state/actions";
import { plain, unwrapped } from "../ui/paragraphs";
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
      <p>{plain(row.summary)}</p>
      {type && (
        <>
          {(type.ports ?? []).filter((one) => one.kind !== "parameter").map((one) => (
            <div className="prt" key={`${one.kind}/${one.name}`} style={{ gridTemplateColumns: "12px minmax(0, 1fr) auto" }}>
              <i className={one.kind === "slot" || one.kind === "event" ? "ci" : "sq"} />
              <span title={type.docs[`${one.kind}/${one.name}`]}>
                {one.name}
                <em>{one.type}</em>
              </span>
              <span className="v" style={{ color: "var(--you)" }}>
                {port !== "" && row.fit !== "refused" && row.port === one.name ? "connects" : ""}
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
          {type.doc.length > type.summary.length + 1 && <p style={{ whiteSpace: "pre-wrap", marginTop: 8 }}>{plain(unwrapped((type.doc.startsWith(type.summary) ? type.doc.slice(type.summary.length) : type.doc).trim()))}</p>}
          {type.example && (
            <>
              <h5>In code</h5>
              <pre className="mono example">{type.example}</pre>
            </>
          )}
        </>
      )}
    </>
  );
}
