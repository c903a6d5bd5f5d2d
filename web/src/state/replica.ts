import type { Op, Tables } from "../protocol/types";

export const EMPTY: Tables = {
  nodes: {},
  edges: {},
  gates: {},
  groups: {},
  ports: {},
  types: {},
  annotations: {},
  layouts: {},
  problems: {},
  breakpoints: {},
  studio: {},
};

/** Puts and drops records. Tables that no op names stay the same objects, so that nothing is drawn again for them. */
export function applied(tables: Tables, ops: readonly Op[]): Tables {
  const changed: Record<string, Record<string, unknown>> = {};
  for (const [table, key, record] of ops) {
    const copy = (changed[table] ??= { ...(tables[table as keyof Tables] as Record<string, unknown>) });
    if (record === null) delete copy[key];
    else copy[key] = record;
  }
  return { ...tables, ...(changed as Partial<Tables>) };
}

export function fromSnapshot(tables: Partial<Tables>): Tables {
  return { ...EMPTY, ...tables };
}
