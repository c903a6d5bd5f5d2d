import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { type Listener, Socket } from "./socket";

class Wire {
  static readonly OPEN = 1;
  static all: Wire[] = [];
  readyState = Wire.OPEN;
  sent: string[] = [];
  onmessage: ((event: { data: string }) => void) | null = null;
  onclose: ((event: { code: number; reason: string }) => void) | null = null;
  constructor() {
    Wire.all.push(this);
  }
  send(data: string) {
    this.sent.push(data);
  }
  close() {
    this.readyState = 3;
    this.onclose?.({ code: 1000, reason: "" });
  }
  hears(message: object) {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
}

const listener = { hello: vi.fn(), message: vi.fn(), heard: vi.fn(), opened: vi.fn(), closed: vi.fn(), known: () => null } satisfies Listener;

beforeEach(() => {
  Wire.all = [];
  vi.stubGlobal("WebSocket", Wire);
  vi.stubGlobal("window", globalThis);
});
afterEach(() => void vi.unstubAllGlobals());

test("whoever connects again leaves the connection of before, and what was asked there", async () => {
  const socket = new Socket("ws://here", listener);
  socket.connect();
  const [before] = Wire.all as [Wire];
  before.hears({ t: "hello" });
  const answer = socket.request({ t: "undo" });
  socket.connect();
  await expect(answer).rejects.toThrow("went away before it answered");
  const now = Wire.all[1]!;
  expect(before.readyState).toBe(3);
  expect(listener.closed).not.toHaveBeenCalled();
  now.hears({ t: "hello" });
  const again = socket.request({ t: "undo" });
  before.hears({ t: "ack", id: 2, rev: 1 });
  now.hears({ t: "ack", id: 2, rev: 7 });
  expect(await again).toBe(7);
  expect(Wire.all).toHaveLength(2);
});
