import { useEffect, useRef, useState } from "react";
import { question } from "./actions";
import { useStudio } from "./studio";

/** At most so often an answer is asked for again while the graph changes. */
const EVERY_MS = 250;

/** What the studio answers to a question, asked again when the graph has changed; null before. */
export function useAnswer<T>(what: string, args: Record<string, unknown>): T | null {
  const [answer, setAnswer] = useState<{ asked: string; value: T } | null>(null);
  const last = useRef(0);
  const asked = JSON.stringify([what, args]);
  const graph = useStudio((s) => s.tables.studio.history);
  const isOpen = useStudio((s) => s.phase === "open");
  useEffect(() => {
    if (!isOpen) return;
    let gone = false;
    const ask = () => {
      last.current = performance.now();
      void question<T>(what, JSON.parse(asked)[1] as Record<string, unknown>).then(
        (value) => !gone && setAnswer({ asked, value }),
        () => undefined, // what it is about is gone; the page is about to know
      );
    };
    const wait = answer?.asked === asked ? EVERY_MS - (performance.now() - last.current) : 0;
    const timer = setTimeout(ask, Math.max(0, wait));
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [asked, graph, isOpen]);
  return answer?.asked === asked ? answer.value : null;
}
