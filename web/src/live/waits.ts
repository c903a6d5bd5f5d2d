import { create } from "zustand";
import { socket } from "../state/link";
import { useStudio } from "../state/studio";

/** Why a node waits, in the studio's words, and since when, in seconds of the run. */
export type Wait = [says: string, since: number];
/** How many tokens are on an edge, and how many it has places for. */
export type Full = [tokens: number, places: number, since: number];

interface Waits {
  nodes: Record<string, Wait>;
  edges: Record<string, Full>;
}

const NOTHING: Waits = { nodes: {}, edges: {} };

/** Nodes and edges of the level that have stood still for a second or more. */
export const useWaits = create<Waits>()(() => NOTHING);

export function watchWaits(): void {
  const subscription = socket.subscribe("waits", { level: useStudio.getState().level }, 2, (value) => useWaits.setState((value as Waits | null) ?? NOTHING));
  useStudio.subscribe((now, before) => {
    if (now.level !== before.level) subscription.change({ level: now.level });
    const run = now.tables.studio.run;
    const isOver = run?.state === "ended" || run?.state === "rest";
    const isOther = run?.number !== before.tables.studio.run?.number;
    if (now.level !== before.level || isOther || (isOver && useWaits.getState() !== NOTHING)) useWaits.setState(NOTHING);
  });
}
