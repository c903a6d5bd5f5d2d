import { create } from "zustand";

interface Tip {
  path: string | null;
  x: number;
  y: number;
}

export const useTip = create<Tip>()(() => ({ path: null, x: 0, y: 0 }));

const WAIT_MS = 300;
let timer = 0;

export function showTip(path: string, x: number, y: number): void {
  if (useTip.getState().path === path) return;
  clearTimeout(timer);
  timer = window.setTimeout(() => useTip.setState({ path, x, y }), WAIT_MS);
}

export function hideTip(): void {
  clearTimeout(timer);
  if (useTip.getState().path !== null) useTip.setState({ path: null });
}
