/** The studio's own signs on a 16 px grid: characters of a font would be missing on some machines. */
const PATHS = {
  pause: '<path d="M5 3v10M11 3v10" stroke-width="2.5"/>',
  play: '<path d="M5 3l8 5-8 5z" fill="currentColor"/>',
  back: '<path d="M13 3v10M10 4l-7 4 7 4z"/>',
  wave: '<path d="M3 3v10M6 4l7 4-7 4z"/>',
  step: '<path d="M8 2v6m-3-3 3 3 3-3"/><circle cx="8" cy="12.5" r="1.8"/>',
  stop: '<rect x="4" y="4" width="8" height="8" rx="1" fill="currentColor"/>',
  undo: '<path d="M6 3 3 6l3 3M3 6h6a4 4 0 0 1 0 8H6"/>',
  redo: '<path d="M10 3l3 3-3 3M13 6H7a4 4 0 0 0 0 8h3"/>',
  find: '<circle cx="7" cy="7" r="4.2"/><path d="M10.2 10.2 14 14"/>',
  sun: '<circle cx="8" cy="8" r="3"/><path d="M8 1v2M8 13v2M1 8h2M13 8h2M3 3l1.4 1.4M11.6 11.6 13 13M13 3l-1.4 1.4M4.4 11.6 3 13"/>',
  tree: '<path d="M3 3h5M5 3v9h3M5 7.5h3M10 7.5h3M10 12h3"/>',
  states: '<circle cx="4" cy="4" r="2.5"/><circle cx="12" cy="12" r="2.5" fill="currentColor"/><path d="M6.500 4H10a2 2 0 0 1 2 2v3.500M10 7.500l2 2 2-2"/>',
  plus: '<path d="M8 3v10M3 8h10"/>',
  minus: '<path d="M3 8h10"/>',
  history: '<circle cx="8" cy="8" r="5.5"/><path d="M8 5v3l2 2"/>',
  record: '<circle cx="8" cy="8" r="5.5"/><circle cx="8" cy="8" r="2" fill="currentColor"/>',
  help: '<circle cx="8" cy="8" r="6"/><path d="M6.3 6.3a1.8 1.8 0 1 1 2.5 1.7c-.6.3-.8.6-.8 1.2M8 11.5v.01"/>',
  eye: '<path d="M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8z"/><circle cx="8" cy="8" r="2"/>',
  more: '<path d="M3.5 8h.01M8 8h.01M12.5 8h.01" stroke-width="2.2"/>',
  gate: '<path d="M3 13V5M13 13V5M3 7h10"/><path d="M3 4h10" stroke-width="2.4"/>',
  clock: '<circle cx="8" cy="8" r="5.5"/><path d="M8 5v3h2.5"/>',
  hourglass: '<path d="M4 2h8M4 14h8M5 2c0 4 6 8 6 12M11 2c0 4-6 8-6 12"/>',
  error: '<path d="M8 1.5 15 14H1z"/><path d="M8 6v4M8 12v.01"/>',
  pin: '<path d="M6 2h4l-.5 4 2 2.5h-7l2-2.5zM8 8.5V14"/>',
  close: '<path d="M4 4l8 8M12 4l-8 8"/>',
  enter: '<path d="M9 3h4v10H9M3 8h7M7 5l3 3-3 3"/>',
  fit: '<path d="M2 6V2h4M14 6V2h-4M2 10v4h4M14 10v4h-4"/>',
  nested: '<rect x="1.5" y="2" width="13" height="12" rx="1.5"/><path d="M4 5h3v2.500H4zM9 8.500h3V11H9zM7 6.250h3.500V8.500"/>',
  down: '<path d="M4 6l4 4 4-4"/>',
  right: '<path d="M6 4l4 4-4 4"/>',
  ok: '<path d="M3 8.5l3.5 3.5L13 4.5"/>',
  no: '<circle cx="8" cy="8" r="6"/><path d="M4 12l8-8"/>',
  file: '<path d="M4 2h5l3 3v9H4zM9 2v3h3"/>',
  save: '<path d="M3 3h8l2 2v8H3zM5.5 3v3.500h5V3M5.500 13V9.500h5V13"/>',
  follow: '<path d="M2 8h8M7 5l3 3-3 3M13 3v10"/>',
  bolt: '<path d="M9 1.5 3.500 9H7.500L7 14.500 12.500 7H8.500z"/>',
  view: '<rect x="2" y="3" width="12" height="10" rx="1"/><path d="M2.500 11.500 6 7.500l2.500 2.500L10.500 8l3 3"/>',
  lock: '<rect x="3.5" y="7" width="9" height="6.5" rx="1"/><path d="M5.500 7V5a2.500 2.500 0 0 1 5 0v2"/>',
  layout: '<rect x="5.500" y="1.500" width="5" height="3.500" rx=".8"/><rect x="1.500" y="11" width="5" height="3.500" rx=".8"/><rect x="9.500" y="11" width="5" height="3.500" rx=".8"/><path d="M8 5v3M4 11V8h8v3"/>',
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name, size }: { name: IconName; size?: number }) {
  const style = size === undefined ? undefined : { width: size, height: size };
  return (
    <svg
      className="i"
      viewBox="0 0 16 16"
      aria-hidden="true"
      style={style}
      dangerouslySetInnerHTML={{ __html: PATHS[name] }}
    />
  );
}
