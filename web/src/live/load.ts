import { create } from "zustand";
import { socket } from "../state/link";

export interface Load {
  firings_hz: number;
  groups: Record<string, { busy_share: number; rate_hz: number; queued: number }>;
}

/** How busy the groups are, twice a second. */
export const useLoad = create<{ load: Load | null }>()(() => ({ load: null }));

export function watchLoad(): void {
  socket.subscribe("load", {}, 2, (value) => useLoad.setState({ load: value as Load }));
}
