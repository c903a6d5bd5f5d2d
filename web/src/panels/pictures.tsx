import type { ReactNode } from "react";

/** Small pictures of graphs in the page's own notation. */
function Box({ x, y, w, name, active }: { x: number; y: number; w: number; name: string; active?: boolean }) {
  return (
    <>
      <rect x={x} y={y} width={w} height="28" rx="5" fill="var(--surface)" stroke={active ? "var(--on)" : "var(--edge-soft)"} strokeWidth={active ? 2.5 : 1.25} />
      <text x={x + w / 2} y={y + 18} textAnchor="middle" fontSize="11" fontWeight="600" fill="var(--ink)">
        {name}
      </text>
    </>
  );
}

const Square = ({ x, y }: { x: number; y: number }) => <rect x={x - 4} y={y - 4} width="8" height="8" fill="var(--edge)" />;
const Circle = ({ x, y }: { x: number; y: number }) => <circle cx={x} cy={y} r="4.5" fill="var(--surface)" stroke="var(--edge)" strokeWidth="1.5" />;
const Line = ({ d }: { d: string }) => <path d={d} fill="none" stroke="var(--data)" strokeWidth="1.5" />;

function Double({ d }: { d: string }) {
  return (
    <>
      <path d={d} className="wire act" />
      <path d={d} className="wire core" style={{ stroke: "var(--surface2)" }} />
    </>
  );
}

function Frame({ children }: { children: ReactNode }) {
  return (
    <svg width="100%" height="132" viewBox="0 0 240 132" aria-hidden="true">
      {children}
    </svg>
  );
}

export const CARD_PICTURES: ReactNode[] = [
  <Frame key="mission">
    <Double d="M120 32V52" />
    <Double d="M120 80V100" />
    <Box x={80} y={4} w={80} name="fetch" />
    <Box x={80} y={52} w={80} name="bring" active />
    <Box x={80} y={100} w={80} name="deliver" />
    <Circle x={120} y={52} />
    <Circle x={120} y={100} />
  </Frame>,
  <Frame key="two">
    <Line d="M84 66H148" />
    <Box x={16} y={52} w={68} name="count" />
    <Box x={148} y={52} w={76} name="show" />
    <Square x={84} y={66} />
    <Square x={148} y={66} />
  </Frame>,
  <Frame key="coins">
    <Line d="M66 40H92V66H100" />
    <Line d="M156 66H172V102H156" />
    <Box x={10} y={26} w={56} name="photo" />
    <Box x={100} y={52} w={56} name="blur" />
    <Box x={84} y={88} w={72} name="circles" />
    <Square x={66} y={40} />
    <Square x={100} y={66} />
    <Square x={156} y={66} />
    <Square x={156} y={102} />
  </Frame>,
  <Frame key="wait">
    <Double d="M120 46V84" />
    <Box x={76} y={18} w={88} name="wait" active />
    <Box x={76} y={84} w={88} name="drive" />
    <Circle x={120} y={46} />
    <Circle x={120} y={84} />
  </Frame>,
];
