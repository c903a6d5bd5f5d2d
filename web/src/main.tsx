import "./styles/index.css";
import { createRoot } from "react-dom/client";
import { App } from "./App";
import { watchActivity } from "./live/activity";
import { watchLoad } from "./live/load";
import { watchWaits } from "./live/waits";
import { socket, watchAge } from "./state/link";
import { change, isNarrow, studio } from "./state/studio";
import { applyTheme } from "./ui/colours";

applyTheme(studio().theme);
createRoot(document.getElementById("app")!).render(<App />);
watchActivity();
watchLoad();
watchWaits();
watchAge();
socket.connect();
document.addEventListener("visibilitychange", () => socket.send({ t: "visible", on: !document.hidden }));
let narrow = isNarrow();
window.addEventListener("resize", () => {
  if (isNarrow() !== narrow) change({ side: narrow, stage: narrow });
  narrow = isNarrow();
});
