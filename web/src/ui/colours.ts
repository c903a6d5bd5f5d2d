/** The tokens as texts, for what is drawn on a canvas; read again when the theme changes. */
let cache = new Map<string, string>();
const listeners = new Set<() => void>();

export function colour(token: string): string {
  const known = cache.get(token);
  if (known !== undefined) return known;
  const value = getComputedStyle(document.documentElement).getPropertyValue(`--${token}`).trim();
  cache.set(token, value);
  return value;
}

export function onTheme(act: () => void): () => void {
  listeners.add(act);
  return () => listeners.delete(act);
}

export function applyTheme(theme: "light" | "dark"): void {
  document.documentElement.dataset.theme = theme;
  cache = new Map();
  for (const act of listeners) act();
}
