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

const Two = (
  <Frame>
    <Line d="M84 66H148" />
    <Box x={16} y={52} w={68} name="clock" />
    <Box x={148} y={52} w={76} name="wave" />
    <Square x={84} y={66} />
    <Square x={148} y={66} />
  </Frame>
);

const Signal = (
  <Frame>
    <Double d="M152 56V84" />
    <Line d="M68 42H108" />
    <Box x={12} y={28} w={56} name="radio" />
    <Box x={108} y={28} w={88} name="wait" active />
    <Box x={108} y={84} w={88} name="drive" />
    <Square x={68} y={42} />
    <Square x={108} y={42} />
    <Circle x={152} y={56} />
    <Circle x={152} y={84} />
  </Frame>
);

/** What the camera sees, and the mission that follows it. */
const Ball = (
  <svg width="404" height="232" viewBox="0 0 404 232" aria-hidden="true">
    <g transform="translate(16 46)">
      <rect width="224" height="140" rx="4" fill="#39424c" />
      <path d="M162 0H220a4 4 0 0 1 4 4V136a4 4 0 0 1-4 4H162z" fill="#6d7884" />
      <path d="M174 0V140M190 0V140M206 0V140" stroke="#5b6570" strokeWidth="5" />
      <path d="M34 112 96 60 132 30" fill="none" stroke="#c9d4df" strokeWidth="1" strokeDasharray="2 5" />
      <circle cx="96" cy="60" r="12" fill="#eef2f6" />
      <circle cx="96" cy="60" r="19" fill="none" stroke="#6fd19a" strokeWidth="2.5" />
    </g>
    <g transform="translate(252 0)">
      <Double d="M72 64V100" />
      <Double d="M72 128V164" />
      <Double d="M112 178H134V50H112" />
      <Box x={32} y={36} w={80} name="search" />
      <Box x={32} y={100} w={80} name="follow" active />
      <Box x={32} y={164} w={80} name="rest" />
      <Circle x={72} y={64} />
      <Circle x={72} y={100} />
      <Circle x={72} y={128} />
      <Circle x={72} y={164} />
    </g>
  </svg>
);

export const STARTER_PICTURES: Record<string, ReactNode> = { ball: Ball, two_nodes: Two, start_signal: Signal };
