import type { NodeBox, PortSpot } from "../protocol/types";
import { useStudio } from "../state/studio";

const SHAPES: Record<PortSpot["kind"], string> = {
  input: "sq",
  output: "sq",
  slot: "ci",
  event: "ci",
  parameter: "pa",
  timeout: "to",
};

interface Props {
  box: NodeBox;
  path: string;
  active: boolean;
  limit: number | null;
}

/** The ports of a node where the layout puts them: squares are synchronous, circles are not. */
export function NodePorts({ box, path, active }: Props) {
  return (
    <>
      {box.ports.map((port) => (
        <Port key={`${port.kind}.${port.name}`} port={port} x={port.x - box.x} y={port.y - box.y} node={path} active={active} />
      ))}
    </>
  );
}

/** Names at the sides have room below the row of bars only; the tooltip has the others. */
const BELOW_BARS = 58;

const isSide = (port: PortSpot): boolean => port.kind === "input" || port.kind === "output" || port.kind === "parameter";

interface PortProps {
  port: PortSpot;
  x: number;
  y: number;
  node: string;
  active: boolean;
}

function Port({ port, x, y, node, active }: PortProps) {
  const path = `${node}.${port.name}`;
  const broken = useStudio((s) => path in s.tables.breakpoints);
  const shape = SHAPES[port.kind];
  const title = port.kind === "timeout" ? `time-out: hands the activity on after ${port.says}` : undefined;
  return (
    <>
      {port.says !== "" && (y >= BELOW_BARS || !isSide(port)) && <PortName port={port} x={x} y={y} />}
      <i
        className={`port nodrag nopan ${shape}${port.kind === "timeout" && active ? " on" : ""}${broken ? " broken" : ""}`}
        style={{ left: x, top: y }}
        data-port={path}
        data-kind={port.kind}
        title={title}
      />
    </>
  );
}

function PortName({ port, x, y }: { port: PortSpot; x: number; y: number }) {
  switch (port.kind) {
    case "slot":
      return (
        <span className="pn" style={{ left: x, top: y + 6 }}>
          {port.says}
        </span>
      );
    case "event":
      return (
        <span className="pn" style={{ left: x, top: y - 17 }}>
          {port.says}
        </span>
      );
    case "timeout":
      return (
        <span className="pn l" style={{ left: x + 11, top: y - 13 }}>
          {port.says}
        </span>
      );
    case "output":
      return (
        <span className="pn r" style={{ left: x - 10, top: y - 6 }}>
          {port.says}
        </span>
      );
    default:
      return (
        <span className="pn l" style={{ left: x + 12, top: y - 6 }}>
          {port.says}
        </span>
      );
  }
}
