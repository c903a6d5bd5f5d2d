import { useEffect } from "react";
import { Canvas } from "./canvas/Canvas";
import { Inspector } from "./inspector/Inspector";
import { useKeys } from "./keys/useKeys";
import { Menu } from "./panels/Menu";
import { Outline } from "./panels/Outline";
import { Popovers } from "./panels/Popovers";
import { StartPage } from "./panels/StartPage";
import { States } from "./panels/States";
import { useFailures } from "./panels/useFailures";
import { FileBar } from "./shell/FileBar";
import { Rail } from "./shell/Rail";
import { StatusBar } from "./shell/StatusBar";
import { Toasts } from "./shell/Toasts";
import { TopBar } from "./shell/TopBar";
import { Stage } from "./stage/Stage";
import { useOffers } from "./stage/offers";
import { isStart } from "./state/looking";
import { keepTheme, useStudio } from "./state/studio";
import { BottomPanel } from "./timeline/BottomPanel";
import { applyTheme } from "./ui/colours";
import { Guard } from "./ui/Guard";

export function App() {
  const theme = useStudio((s) => s.theme);
  const side = useStudio((s) => s.side);
  const old = useStudio((s) => s.age === 3);
  const start = useStudio(isStart);
  const name = useStudio((s) => s.tables.studio.file?.graph ?? "");
  const staged = useStudio((s) => s.stage);
  const hasViews = useOffers().views.length > 0;
  useKeys();
  useFailures();
  useEffect(() => {
    document.title = start || name === "" ? "hfg studio" : `${name} · hfg studio`;
  }, [start, name]);
  useEffect(() => {
    applyTheme(theme);
    keepTheme(theme);
  }, [theme]);
  const classes = ["frame", !side && "noside", staged && hasViews && !start && "staged", old && "old"].filter(Boolean).join(" ");
  return (
    <div className={classes}>
      <TopBar />
      <Rail />
      {start ? (
        <>
          <StartPage />
          <div className="over-start">
            <Toasts />
          </div>
        </>
      ) : (
        <>
          {staged && hasViews && (
            <Guard of="The views">
              <Stage />
            </Guard>
          )}
          <div className="middle">
            <FileBar />
            <Guard of="The graph">
              <Canvas />
            </Guard>
            <Outline />
            <Guard of="The states">
              <States />
            </Guard>
            <Toasts />
          </div>
          <Guard of="The inspector">
            <Inspector />
          </Guard>
          <Guard of="The timeline">
            <BottomPanel />
          </Guard>
        </>
      )}
      <StatusBar />
      <Menu />
      <Popovers />
      <Announcements />
    </div>
  );
}

/** Changes of activity for screen readers, at most one a second. */
function Announcements() {
  const text = useStudio((s) => s.announced);
  return (
    <div className="hidden-text" aria-live="polite">
      {text}
    </div>
  );
}
