import { useStudio } from "../state/studio";
import { Probe } from "./Probe";

export function Probes() {
  const pins = useStudio((s) => s.pins);
  if (pins.length === 0) return null;
  return (
    <div className="sec" style={{ border: 0, paddingTop: 4 }}>
      <h3>
        Probes<span className="sp" />
        <small>{pins.length} pinned</small>
      </h3>
      {pins.map((path) => (
        <Probe key={path} path={path} />
      ))}
    </div>
  );
}
