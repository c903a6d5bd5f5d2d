import type { AnnotationRecord, Command } from "../protocol/types";
import { edit, question, toast } from "./actions";
import { change, studio } from "./studio";

interface Wanted {
  kind: AnnotationRecord["kind"];
  level?: string;
  name?: string;
  text?: string;
  at?: [number, number];
  size?: [number, number];
  paths?: string[];
  removed?: boolean;
}

export const keyOf = (one: AnnotationRecord): string => `${one.level} ${one.name}`;

export const pickAnnotation = (key: string | null): void => change({ annotation: key });

/** Makes, changes or removes a note or frame; returns its key. The studio says which commands that takes. */
export async function annotate(wanted: Wanted): Promise<string | null> {
  try {
    const { key, commands } = await question<{ key: string; commands: Command[] }>("annotate", { level: studio().level, ...wanted });
    return (await edit(commands)) ? key : null;
  } catch (error) {
    toast(error instanceof Error ? error.message : String(error), { kind: "bad" });
    return null;
  }
}

export async function addAnnotation(wanted: Wanted): Promise<void> {
  const key = await annotate(wanted);
  if (key !== null) change({ annotation: key, writing: key });
}

export async function removeAnnotation(key: string): Promise<void> {
  const one = studio().tables.annotations[key];
  change({ annotation: null });
  if (one) await annotate({ kind: one.kind, level: one.level, name: one.name, removed: true });
}
