/** What the studio sends, as in docs/howto/studio.md. The page shows these records and computes none of them. */

export type PortKind = "input" | "output" | "slot" | "event" | "parameter" | "timeout";
export type Data = null | boolean | number | string | Data[] | { [name: string]: Data };

export interface PortRecord {
  name: string;
  kind: PortKind;
  path: string;
  type: string;
  optional?: boolean;
  auto?: boolean;
  used?: boolean;
}

export interface NodeRecord {
  path: string;
  name: string;
  level: string;
  type: string;
  title: string;
  group: string;
  own_group: string | null;
  options: Record<string, Data>;
  parameters: Record<string, Data>;
  locked: Record<string, string>;
  shown: string[];
  enabled: boolean;
  subgraph: boolean;
  unnamed?: boolean;
  inside: number;
  ports: PortRecord[];
  missing: string;
  activity: boolean;
  notes: Record<string, Data>;
}

export interface EdgeRecord {
  source: string;
  target: string;
  level: string;
  active: boolean;
  options: Record<string, Data>;
  signal: boolean;
  back: boolean;
}

export interface GateRecord {
  target: string;
  by: string;
  idle_rate_hz: number | null;
  level: string;
}

/** A note on the canvas, or a frame around nodes. */
export interface AnnotationRecord {
  level: string;
  name: string;
  kind: "note" | "frame";
  text: string;
  at: [number, number];
  size: [number, number];
  members: string[];
}

export interface GroupRecord {
  name: string;
  threads: number | null;
  policy: string;
  process: string | null;
  host: string | null;
  number: number;
}

export interface Limits {
  gt?: number;
  ge?: number;
  lt?: number;
  le?: number;
  multiple_of?: number;
  min_length?: number;
  max_length?: number;
  predicate?: string;
}

export interface ParameterType {
  name: string;
  kind: string;
  type: string;
  doc: string;
  default: Data;
  required: boolean;
  /** It may be nothing, null. */
  optional?: boolean;
  limits: Limits | null;
  low: number | null;
  high: number | null;
  choices: Data[] | null;
  labels: string[];
  unit: string | null;
  step: number | null;
  group: string | null;
  read_only: boolean;
  /** Of a vector or matrix: how long each axis is, null for any length. */
  shape?: (number | null)[] | null;
  [more: string]: unknown;
}

export interface ViewRecord {
  name: string;
  title: string;
  doc: string;
}

export interface ActionRecord {
  name: string;
  label: string;
  doc: string;
  undoable: boolean;
  /** With what the action suggests as defaults. */
  arguments: ParameterType[];
}

export interface TypeRecord {
  reference: string;
  title: string;
  category: string;
  summary: string;
  doc: string;
  subgraph: boolean;
  source: string;
  parameters: ParameterType[];
  /** Of its ports by "kind/name". */
  docs: Record<string, string>;
  /** Only of a type that was asked for by itself. */
  ports?: { kind: PortKind; name: string; type: string }[];
  views: ViewRecord[];
  actions: ActionRecord[];
  example?: string;
}

/** A drawing in the coordinates of its world: shapes by kind, those before below those behind. */
export interface Scene {
  bounds: [left: number, bottom: number, right: number, top: number];
  caption: string;
  shapes: Shape[];
}

export type Shape =
  | ["line", points: Point[], fill: "", colour: string, width: number]
  | ["area", points: Point[], fill: string, colour: string, width: number]
  | ["disc", at: Point, radius: number, fill: string, colour: string, width: number]
  | ["rays", begin: Point, ends: Point[], colour: string]
  | ["text", text: string, at: Point, size: number, colour: string, anchor: "start" | "middle" | "end"]
  | ["image", base64: string, box: [left: number, bottom: number, right: number, top: number]];

export type Point = [number, number];

export interface PortSpot {
  kind: PortKind;
  name: string;
  x: number;
  y: number;
  says: string;
}

export interface LayoutBadge {
  kind: "gate" | "timeout";
  says: string;
  by: string;
}

export interface NodeBox {
  id: string;
  name: string;
  kind: "node" | "subgraph" | "feed";
  type_name: string;
  group: string;
  x: number;
  y: number;
  width: number;
  height: number;
  row: number | null;
  lane: number;
  is_state: boolean;
  is_active: boolean;
  is_enabled: boolean;
  is_open: boolean;
  inner: number;
  details: string[];
  badges: LayoutBadge[];
  ports: PortSpot[];
}

export interface LayoutTag {
  text: string;
  ports: string[];
  kind: "input" | "output" | "slot" | "event" | "start" | "stop" | "parameter";
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface LayoutLine {
  edges: { source: string; target: string; label: string }[];
  kind: "data" | "signal";
  is_active: boolean;
  is_back: boolean;
  points: Point[];
  combs: Point[][];
  dots: Point[];
  count_at: Point | null;
  says: string;
  says_at: Point | null;
  tag: LayoutTag | null;
}

export interface LayoutRecord {
  title: string;
  view: "activity" | "mission" | "all";
  width: number;
  height: number;
  nodes: NodeBox[];
  lines: LayoutLine[];
  groups: string[];
  hidden: number;
  /** Nodes that people have put in their places. */
  fixed: string[];
  /** With what is inside of its subgraphs. */
  deep: boolean;
}

export interface ProblemRecord {
  path: string;
  severity: "error" | "warning" | "hint";
  what: string;
  why: string;
  remedy: string;
  check: string;
  source: "check" | "run" | "file";
  at_s: number | null;
  seen: boolean;
  fixes: { text: string; message: Message }[];
}

export interface BreakpointRecord {
  path: string;
  hits: number;
  holds: boolean;
  condition: string;
  when: { op: string; value: Data; field?: string } | null;
  why_not: string;
}

export interface RunRecord {
  state: "rest" | "starting" | "running" | "paused" | "stepping" | "ended";
  outcome: string;
  elapsed_s: number;
  at: number;
  why: string;
  error: { message: string; path: string; what: string; remedy: string; traceback: string } | null;
  number: number;
  steerable: boolean;
  clock: string;
  /** Of a recording, how long it is. */
  length_s?: number | null;
}

export interface HistoryStep {
  n: number;
  text: string;
  by: number;
  at: number;
}

export interface HistoryRecord {
  done: HistoryStep[];
  undone: HistoryStep[];
  /** Actions that were carried out and cannot be undone. */
  calls: HistoryStep[];
  saved: number;
}

export interface FileRecord {
  name: string;
  path: string;
  folder: string;
  kind: "yaml" | "python" | "recording" | "none";
  changes: number;
  can_save: boolean | string;
  elsewhere: string;
  /** The name of the graph. */
  graph: string;
  journal: { changes: number; at: number } | null;
}

export interface Tables {
  nodes: Record<string, NodeRecord>;
  edges: Record<string, EdgeRecord>;
  gates: Record<string, GateRecord>;
  groups: Record<string, GroupRecord>;
  ports: Record<string, PortRecord>;
  types: Record<string, TypeRecord>;
  annotations: Record<string, AnnotationRecord>;
  layouts: Record<string, LayoutRecord>;
  problems: Record<string, ProblemRecord>;
  breakpoints: Record<string, BreakpointRecord>;
  studio: { run?: RunRecord; history?: HistoryRecord; file?: FileRecord; viewers?: { count: number } };
}

export interface Hello {
  t: "hello";
  v: number;
  boot: string;
  viewer: number;
  name: string;
  version: string;
  read_only: string;
  automatic: Record<string, { name: string; type: string }[]>;
  topics: string[];
  now: number;
  /** What a page shows first. */
  level: string;
}

export interface Reject {
  t: "reject";
  id: number;
  code: string;
  message: string;
  path: string;
  expected: string;
  sent: string;
  reason: string;
  remedy: string;
  choices: string[];
}

export type Op = [table: string, key: string, record: unknown];

export type FromStudio =
  | Hello
  | { t: "snapshot"; rev: number; tables: Partial<Tables> }
  | { t: "patch"; rev: number; ops: Op[]; by: number; text: string }
  | { t: "ack"; id: number; rev: number }
  | { t: "answer"; id: number; value: unknown }
  | Reject
  | { t: "data"; sub: number; seq: number; time: number; value: unknown }
  | { t: "gone"; sub: number; message: string };

export type Message = { t: string; [field: string]: unknown };
export type Command = { do: string; [field: string]: Data | undefined };

export interface Fit {
  fit: "expects" | "takes" | "refused";
  expected: string;
  sent: string;
  /** With {port} for the name of the port, and {from} for where the edge comes from that it has. */
  reason: string;
  remedy: string;
}

/** What an edge may lead to: all ports of which the same is said together. */
export interface Targets {
  sends?: string;
  expects?: string;
  counts: { expects: number; takes: number; refused: number };
  fits: (Fit & { ports: string[] })[];
}

export interface FoundRow {
  reference: string;
  title: string;
  name: string;
  category: string;
  summary: string;
  fit: "expects" | "takes" | "refused" | "";
  port: string;
  message: string;
}

export interface Found {
  rows: FoundRow[];
  near: string[];
  total: number;
  refused: number;
}

export interface Value {
  /** When it was seen, in seconds of the run: that of its frame. */
  time: number;
  stamp: number | null;
  number: number;
  activity: boolean;
  kind: "number" | "text" | "image" | "array" | "table" | "record" | "marker" | "none" | "other";
  summary: string;
  data: Data;
  shape: number[] | null;
  dtype: string | null;
  rate_hz: number;
  seen: number;
  message: string;
}

export interface NodeMeasures {
  waiting: Record<string, number>;
  doing: string;
  p50_s: number | null;
  p99_s: number | null;
  max_s: number | null;
  rate_hz: number;
  firings: number;
  calls: number;
  failed: number;
  queued: number;
  active_share: number;
  busy_share: number;
}
