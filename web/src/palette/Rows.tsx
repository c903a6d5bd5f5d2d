import { useEffect, useRef, useState } from "react";
import type { Found, FoundRow } from "../protocol/types";
import { plain } from "../ui/paragraphs";
import { partsOf } from "./marking";

interface Props {
  found: Found | null;
  words: string;
  index: number;
  choose: (index: number) => void;
  add: (row: FoundRow) => void;
}

/** What fits first; what does not is below, with the reason, and can still be added. */
export function Rows({ found, words, index, choose, add }: Props) {
  const list = useRef<HTMLUListElement>(null);
  useEffect(() => {
    list.current?.querySelector(".sel")?.scrollIntoView({ block: "nearest" });
  }, [index]);
  const mouse = useRef("");
  /** Rows that scroll by under a mouse that rests are not chosen by it. */
  const hover = (x: number, y: number, at: number) => {
    const place = `${x} ${y}`;
    if (mouse.current !== "" && mouse.current !== place && at !== index) choose(at);
    mouse.current = place;
  };
  const slow = useSlow(found === null);
  const rows = found?.rows ?? [];
  if (found && rows.length === 0) {
    return (
      <ul id="palette-rows" role="listbox" aria-label="Node types">
        <li className="hd" role="option" aria-selected="false">
          No node type speaks of “{words}”.{found.near.length > 0 && ` Near it: ${found.near.join(", ")}.`}
        </li>
      </ul>
    );
  }
  const firstRefused = rows.findIndex((row) => row.fit === "refused");
  return (
    <ul id="palette-rows" role="listbox" aria-label="Node types" ref={list}>
      {slow && (
        <li className="hd" role="option" aria-selected="false">
          Reading the catalogue of node types
        </li>
      )}
      {rows.map((row, at) => (
        <li
          key={row.reference + row.port}
          id={`row-${row.reference}`}
          role="option"
          aria-selected={at === index}
          className={`${at === index ? "sel" : ""}${row.fit === "refused" ? " no" : ""}${at === firstRefused ? " first-no" : ""}`}
          onPointerMove={(event) => hover(event.clientX, event.clientY, at)}
          onPointerDown={() => choose(at)}
          onDoubleClick={() => add(row)}
        >
          <span className="cat">{row.category}</span>
          <b>
            <Marked text={row.name || row.title} words={words} />
          </b>
          <div>{row.fit === "refused" ? row.message : <Marked text={plain(row.summary)} words={words} />}</div>
        </li>
      ))}
    </ul>
  );
}

/** Whether something takes longer than one would notice. */
function useSlow(waits: boolean): boolean {
  const [slow, setSlow] = useState(false);
  useEffect(() => {
    setSlow(false);
    if (!waits) return;
    const timer = setTimeout(() => setSlow(true), 300);
    return () => clearTimeout(timer);
  }, [waits]);
  return slow && waits;
}

/** The letters that were typed stand out. */
function Marked({ text, words }: { text: string; words: string }) {
  return (
    <>
      {partsOf(text, words).map(([part, typed], at) => (typed ? <mark key={at}>{part}</mark> : part))}
    </>
  );
}
