import type { ActionRecord, NodeRecord, TypeRecord, ViewRecord } from "../protocol/types";

export interface OfferedView extends ViewRecord {
  key: string;
  path: string;
  type: string;
}

export interface OfferedActions {
  path: string;
  actions: ActionRecord[];
}

/** The views and actions that the nodes of the graph offer, in the order of the nodes. */
export function offersOf(nodes: Record<string, NodeRecord>, types: Record<string, TypeRecord>) {
  const views: OfferedView[] = [];
  const actions: OfferedActions[] = [];
  for (const node of Object.values(nodes)) {
    const type = types[node.type];
    if (!type) continue;
    for (const view of type.views) views.push({ ...view, key: `${node.path}#${view.name}`, path: node.path, type: node.title });
    if (type.actions.length > 0) actions.push({ path: node.path, actions: type.actions });
  }
  return { views, actions };
}

/** Of nodes of the same type, the first one stands for all, until the person chooses. */
export function firstViews(views: readonly OfferedView[]): string[] {
  const seen = new Set<string>();
  return views.flatMap((one) => {
    const kind = `${one.type}#${one.name}`;
    if (seen.has(kind)) return [];
    seen.add(kind);
    return [one.key];
  });
}
