import { useMemo } from "react";
import type { ActionRecord } from "../protocol/types";
import { act, toast } from "../state/actions";
import { change, useStudio } from "../state/studio";
import { offersOf } from "./offered";

export function useOffers() {
  const nodes = useStudio((s) => s.tables.nodes);
  const types = useStudio((s) => s.tables.types);
  return useMemo(() => offersOf(nodes, types), [nodes, types]);
}

/** Asks for the arguments of an action; one without any is carried out at once. */
export function beginAction(path: string, action: ActionRecord, x: number, y: number): void {
  change({ popover: null, menu: null });
  if (action.arguments.length > 0) {
    change({ acting: { path, name: action.name, x, y } });
    return;
  }
  void act(path, action, {}).then((why) => why !== "" && toast(why, { kind: "bad" }));
}
