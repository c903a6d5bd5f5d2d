import { type KeyboardEvent, useEffect, useRef, useState } from "react";
import type { Found, FoundRow } from "../protocol/types";
import { addNode, question, toast } from "../state/actions";
import { nameOf, nodeOf, portOf } from "../state/paths";
import { change, type PaletteAt, useStudio } from "../state/studio";
import { Icon } from "../ui/Icon";
import { plural } from "../ui/words";
import { NodeTypeDoc } from "./NodeTypeDoc";
import { Rows } from "./Rows";

const WIDTH = 648;
const HEIGHT = 404;

/** What it shows when it opens, as the studio said last: one sees it at once, and then what the studio says now. */
let first: Found | null = null;
const FIRST_MS = 1500;

const searched = (words: string, port: string): Promise<Found> => question<Found>("search", { words, port, category: "", most: 50 });

function keepFirst(found: Found): Found {
  if (JSON.stringify(found) !== JSON.stringify(first)) first = found;
  return first!;
}

export function Palette() {
  const at = useStudio((s) => (s.popover === "palette" ? s.palette : null));
  const open = useStudio((s) => s.phase === "open");
  useEffect(() => {
    if (!open) return;
    const timer = setTimeout(() => void searched("", "").then(keepFirst, () => undefined), FIRST_MS);
    return () => clearTimeout(timer);
  }, [open]);
  return at && <PaletteAtPlace key={`${at.screen.x} ${at.screen.y} ${at.port}`} at={at} />;
}

/** Type, choose, add: at the place where it was asked for, connected to the wire that was dropped. */
function PaletteAtPlace({ at }: { at: PaletteAt }) {
  const [words, setWords] = useState(at.words);
  const [port, setPort] = useState(at.port);
  const early = at.words === "" && at.port === "" ? first : null;
  const [found, setFound] = useState<Found | null>(early);
  const [answered, setAnswered] = useState<string | null>(early && "");
  const last = useRef(early && { words: "", port: "" });
  const [index, setIndex] = useState(0);
  /** Words for which somebody has pressed Enter before their answer came: its first row is added once it does. */
  const entered = useRef<{ words: string; connected: boolean } | null>(null);
  const search = useRef({ busy: false, next: null as { words: string; port: string } | null });
  const sends = useStudio((s) => s.tables.nodes[nodeOf(port)]?.ports.find((one) => one.path === port)?.type ?? "");

  useEffect(() => {
    const state = search.current;
    const ask = async (asked: { words: string; port: string }) => {
      state.busy = true; // one search at a time: who types fast is not interested in those between
      try {
        const answer = await searched(asked.words, asked.port);
        setFound(asked.words === "" && asked.port === "" ? keepFirst(answer) : answer);
        setAnswered(asked.words);
        if (last.current?.words !== asked.words || last.current.port !== asked.port) setIndex(0);
        last.current = asked;
      } catch (error) {
        toast(error instanceof Error ? error.message : String(error), { kind: "bad" });
      }
      state.busy = false;
      const next = state.next;
      state.next = null;
      if (next) void ask(next);
    };
    if (state.busy) state.next = { words, port };
    else void ask({ words, port });
  }, [words, port]);

  const rows = found?.rows ?? [];
  const row = answered === words ? rows[index] : undefined; // Enter takes nothing that answers other words
  const close = () => change({ popover: null, palette: null });
  const add = (one: FoundRow | undefined, connected: boolean) => {
    if (!one) return;
    close();
    void addNode(one, at.place, connected && one.fit !== "refused" ? port : "");
  };
  const enter = (connected: boolean) => {
    if (answered === words) add(row, connected);
    else entered.current = { words, connected };
  };
  useEffect(() => {
    if (entered.current === null || entered.current.words !== answered) return;
    add(rows[0], entered.current.connected);
    entered.current = null;
  }, [answered]);
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    if (event.key === "Escape") close();
    if (event.key === "ArrowDown") setIndex(Math.min(rows.length - 1, index + 1));
    if (event.key === "ArrowUp") setIndex(Math.max(0, index - 1));
    if (event.key === "Enter") enter(!event.altKey);
    if (["ArrowDown", "ArrowUp", "Enter", "Tab"].includes(event.key)) event.preventDefault();
  };
  const left = Math.max(52, Math.min(at.screen.x, window.innerWidth - WIDTH - 12));
  const top = Math.max(52, Math.min(at.screen.y, window.innerHeight - HEIGHT - 36));
  return (
    <div className="away" onPointerDown={(event) => event.target === event.currentTarget && close()}>
      <div className="pop palette grows" style={{ left, top, position: "fixed" }} role="dialog" aria-label="Add a node" onKeyDown={key}>
        <div className="in">
          <Icon name="find" />
          <input
            autoFocus
            value={words}
            placeholder="Which node?"
            aria-label="Which node?"
            role="combobox"
            aria-expanded="true"
            aria-controls="palette-rows"
            aria-activedescendant={row ? `row-${row.reference}` : undefined}
            onChange={(event) => {
              entered.current = null;
              setWords(event.target.value);
            }}
          />
          {port !== "" && (
            <span className="chipf">
              takes {sends || "this"}, from {nameOf(nodeOf(port))}.{portOf(port)}
              <button type="button" className="btn small" style={{ color: "inherit", height: 20, minWidth: 20, padding: 0 }} aria-label="Show all node types" onClick={() => setPort("")}>
                <Icon name="close" />
              </button>
            </span>
          )}
        </div>
        <Rows found={found} words={words} index={index} choose={setIndex} add={(one) => add(one, true)} />
        <div className="doc" tabIndex={0} role="region" aria-label="About the node type">
          {row && <NodeTypeDoc row={row} port={port} />}
        </div>
        <div className="ft">
          <span>
            <kbd>↑</kbd> <kbd>↓</kbd> choose
          </span>
          <span>
            <kbd>Enter</kbd> {port === "" ? "add" : "add and connect"}
          </span>
          {port !== "" && (
            <span>
              <kbd>Alt Enter</kbd> add only
            </span>
          )}
          <span className="spring" />
          <span className="num">
            {found && (rows.length < found.total ? `${rows.length} of ${found.total} node types` : plural(rows.length, "node type"))}
          </span>
        </div>
      </div>
    </div>
  );
}
