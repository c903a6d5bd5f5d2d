import { ask, toast } from "../state/actions";
import { isRecording } from "../state/looking";
import { studio } from "../state/studio";
import { record } from "../timeline/store";

/** Where the cursor of a recording is wanted; only the newest place counts, and one request is on its way at a time. */
let wanted: number | null = null;
let asking = false;
let stepping = false;

export function seek(at: number): void {
  wanted = Math.min(Math.max(0, at), record.now);
  record.cursor = wanted;
  record.turn++;
  if (!asking) void go();
}

export const isSeeking = (): boolean => asking;

async function go(): Promise<void> {
  asking = true;
  while (wanted !== null) {
    const at = wanted;
    wanted = null;
    await ask({ t: "seek", at });
  }
  asking = false;
}

/** To the firing after or before the cursor: of the selected node, else of any. A key that is held waits for the answer. */
export async function stepTo(back: boolean, path = [...studio().selection][0] ?? ""): Promise<void> {
  if (stepping || asking || !isRecording(studio().tables.studio.run)) return;
  stepping = true;
  const answer = await ask<{ why_not?: string }>({ t: "step", path, back });
  stepping = false;
  if (answer?.why_not) toast(answer.why_not, {}, 2000);
}
