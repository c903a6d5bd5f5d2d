/** Paths are texts as in commands: "fetch/go_to", "fetch/go_to.goal", "fetch.person.inner". */

export const parentOf = (path: string): string => path.slice(0, Math.max(0, path.lastIndexOf("/")));
export const nameOf = (path: string): string => path.slice(path.lastIndexOf("/") + 1);
export const joined = (level: string, name: string): string => (level === "" ? name : `${level}/${name}`);
export const isInside = (path: string, level: string): boolean => level === "" || path.startsWith(`${level}/`);

/** The path of the node that a port belongs to. */
export function nodeOf(port: string): string {
  const dot = port.indexOf(".", port.lastIndexOf("/") + 1);
  return dot < 0 ? "" : port.slice(0, dot);
}

export function portOf(port: string): string {
  const dot = port.indexOf(".", port.lastIndexOf("/") + 1);
  return dot < 0 ? port : port.slice(dot + 1);
}

export const edgeKey = (source: string, target: string): string => `${source} -> ${target}`;

export function endsOf(edge: string): [source: string, target: string] {
  const at = edge.indexOf(" -> ");
  return [edge.slice(0, at), edge.slice(at + 4)];
}

/** What of a path lies below a level, in words: "visit › position". */
export function below(path: string, level: string): string {
  const rest = level === "" ? path : path.slice(level.length + 1);
  return rest.split("/").join(" › ");
}

/** Those levels in which a path lies, outermost first, without the whole graph. */
export function levelsAbove(path: string): string[] {
  const parts = path.split("/");
  return parts.slice(1).map((_, index) => parts.slice(0, index + 1).join("/"));
}
