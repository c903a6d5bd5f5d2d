import { Palette } from "../palette/Palette";
import { useStudio } from "../state/studio";
import { Commands } from "./Commands";
import { Keys } from "./Keys";
import { OpenFile } from "./OpenFile";
import { Tour } from "./Tour";

export function Popovers() {
  const popover = useStudio((s) => s.popover);
  return (
    <>
      <Palette />
      {popover === "commands" && <Commands />}
      {popover === "keys" && <Keys />}
      {popover === "open" && <OpenFile />}
      {popover === "tour" && <Tour />}
    </>
  );
}
