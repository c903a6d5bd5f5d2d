import { create } from "zustand";
import type { Hello, Tables } from "../protocol/types";
import { EMPTY } from "./replica";
import type { Judged } from "./targets";

export type View = "activity" | "mission" | "all";
export type Tab = "timeline" | "problems" | "log" | "history";
export type Panel = "outline" | "states" | null;
export type Popover = "palette" | "commands" | "keys" | "tour" | "open" | "connect" | "actions" | null;

export interface Toast {
  id: number;
  kind: "plain" | "bad" | "warn";
  title: string;
  text: string;
  action?: { label: string; act: () => void };
}

export interface PaletteAt {
  /** Where on the screen it opens, and the place in the graph that it adds to. */
  screen: { x: number; y: number };
  place: { x: number; y: number };
  port: string;
  words: string;
}

export interface WireDrag {
  from: string;
  moving: string;
  targets: Judged | null;
  over: string | null;
  point: { x: number; y: number };
  screen: { x: number; y: number };
  active: boolean;
}

export interface Activity {
  /** When each active node became so, in seconds of the run. */
  since: Readonly<Record<string, number>>;
  /** Edges over which the activity came last. */
  ways: ReadonlySet<string>;
}

/** An action of a node that waits for its arguments, and where its form opens. */
export interface Acting {
  path: string;
  name: string;
  x: number;
  y: number;
}

export interface Studio {
  phase: "connecting" | "open" | "closed" | "refused";
  closedWhy: string;
  closedAt: number;
  hello: Hello | null;
  clockOffset: number;
  rev: number;
  tables: Tables;
  level: string;
  views: Readonly<Record<string, View>>;
  /** Levels of which the inside of all subgraphs is shown. */
  deep: Readonly<Record<string, boolean>>;
  selection: ReadonlySet<string>;
  selectedEdge: string | null;
  /** The note or frame that is selected, and the one that is being written. */
  annotation: string | null;
  writing: string | null;
  activity: Activity;
  age: 0 | 1 | 3;
  ageSeconds: number;
  theme: "light" | "dark";
  tab: Tab;
  panel: Panel;
  popover: Popover;
  /** Code that is to be opened, and its graphs: one has to be chosen. */
  several: { path: string; names: string[] } | null;
  palette: PaletteAt | null;
  menu: { x: number; y: number; path: string; kind: "node" | "edge" | "canvas" } | null;
  wire: WireDrag | null;
  /** Edges that were asked for, until the studio has drawn or refused them. */
  asked: readonly string[];
  /** The edge that a dragged node would be put on. */
  insertAt: string | null;
  renaming: string | null;
  side: boolean;
  time: boolean;
  /** Whether views of nodes are shown beside the graph, and which: "path#name"; null: as it comes. */
  stage: boolean;
  views_shown: readonly string[] | null;
  acting: Acting | null;
  pins: readonly string[];
  toasts: readonly Toast[];
  announced: string;
  /** Whether the person has begun with an empty graph. */
  begun: boolean;
}

/** Panels lie over the canvas then. */
export const isNarrow = (): boolean => window.innerWidth <= 1100;

const media = window.matchMedia("(prefers-color-scheme: dark)");

const usualTheme = (): "light" | "dark" => (media.matches ? "dark" : "light");

function firstTheme(): "light" | "dark" {
  const kept = localStorage.getItem("hfg-theme");
  return kept === "light" || kept === "dark" ? kept : usualTheme();
}

/** Only another theme than the system's is a choice. */
export function keepTheme(theme: "light" | "dark"): void {
  if (theme === usualTheme()) localStorage.removeItem("hfg-theme");
  else localStorage.setItem("hfg-theme", theme);
}

export const useStudio = create<Studio>()(() => ({
  phase: "connecting",
  closedWhy: "",
  closedAt: 0,
  hello: null,
  clockOffset: 0,
  rev: -1,
  tables: EMPTY,
  level: "",
  views: {},
  deep: {},
  selection: new Set<string>(),
  selectedEdge: null,
  annotation: null,
  writing: null,
  activity: { since: {}, ways: new Set<string>() },
  age: 0,
  ageSeconds: 0,
  theme: firstTheme(),
  tab: "timeline",
  panel: null,
  popover: null,
  several: null,
  palette: null,
  menu: null,
  wire: null,
  asked: [],
  insertAt: null,
  renaming: null,
  side: !isNarrow(),
  time: true,
  stage: !isNarrow(),
  views_shown: null,
  acting: null,
  pins: [],
  toasts: [],
  announced: "",
  begun: false,
}));

export const studio = useStudio.getState;
export const change = useStudio.setState;

/** The layout that the page shows: that of the chosen view, or of the level's own. */
export const layoutKey = (state: Studio): string => `${state.views[state.level] ?? ""}${state.deep[state.level] ? "+" : ""}:${state.level}`;
