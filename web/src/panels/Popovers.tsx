import { Palette } from "../palette/Palette";
import { useStudio } from "../state/studio";
import { ActionForm } from "../stage/ActionForm";
import { ActionMenu } from "../stage/ActionMenu";
import { Commands } from "./Commands";
import { Connect } from "./Connect";
import { Keys } from "./Keys";
import { OpenFile } from "./OpenFile";
import { Tour } from "./Tour";

export function Popovers() {
  const popover = useStudio((s) => s.popover);
  return (
    <>
      <Palette />
      {popover === "actions" && <ActionMenu />}
      <ActionForm />
      {popover === "commands" && <Commands />}
      {popover === "connect" && <Connect />}
      {popover === "keys" && <Keys />}
      {popover === "open" && <OpenFile />}
      {popover === "tour" && <Tour />}
    </>
  );
}
