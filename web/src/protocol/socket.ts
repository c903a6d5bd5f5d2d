import { type Frame, readFrame } from "./frames";
import type { FromStudio, Hello, Message, Reject } from "./types";

/** What the studio says of a request that it refuses. */
export class Refusal extends Error {
  constructor(readonly reject: Reject) {
    super(reject.message);
  }
}

type Handler = (value: unknown, time: number, frame: Frame | null) => void;

interface Subscription {
  topic: string;
  hz: number;
  args: Record<string, unknown>;
  handle: Handler;
  gone: ((message: string) => void) | undefined;
}

interface Waiting {
  resolve: (value: unknown) => void;
  reject: (error: Error) => void;
}

export interface Listener {
  hello(hello: Hello): void;
  message(message: FromStudio): void;
  /** Something has arrived, whatever it is. */
  heard(): void;
  opened(): void;
  closed(code: number, reason: string): void;
  /** Boot and revision of the state that the page has, or null. */
  known(): { boot: string; rev: number } | null;
}

const RETRY_MS = [100, 200, 400, 800];

/** The one socket. It connects again by itself, and then subscribes again to what it was subscribed to. */
export class Socket {
  private socket: WebSocket | null = null;
  private readonly waiting = new Map<number, Waiting>();
  private readonly subscriptions = new Map<number, Subscription>();
  private nextId = 1;
  private nextSub = 1;
  private greeted = false;
  private tries = 0;
  private timer = 0;
  lastWord = performance.now();

  constructor(
    private readonly address: string,
    private readonly listener: Listener,
  ) {}

  connect(): void {
    clearTimeout(this.timer);
    this.leave();
    const socket = new WebSocket(this.address, "hfg.studio.v1");
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.heard(event.data as string | ArrayBuffer);
    socket.onclose = (event) => this.closed(event);
  }

  /** What another connection says afterwards is for nobody. */
  private leave(): void {
    if (this.socket === null) return;
    this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    this.forget();
  }

  private forget(): void {
    this.greeted = false;
    for (const one of this.waiting.values()) one.reject(new Error("The studio went away before it answered."));
    this.waiting.clear();
  }

  /** Before the studio has greeted nothing may be said. */
  get isOpen(): boolean {
    return this.greeted && this.socket?.readyState === WebSocket.OPEN;
  }

  send(message: Message): boolean {
    if (!this.isOpen) return false;
    this.socket?.send(JSON.stringify(message));
    return true;
  }

  request(message: Message): Promise<unknown> {
    const id = this.nextId++;
    if (!this.send({ ...message, id })) {
      return Promise.reject(new Error("The studio does not answer. Edits wait until it does."));
    }
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  subscribe(topic: string, args: Record<string, unknown>, hz: number, handle: Handler, gone?: (m: string) => void) {
    const sub = this.nextSub++;
    this.subscriptions.set(sub, { topic, args, hz, handle, gone });
    this.send({ t: "sub", sub, topic, hz, args });
    return {
      change: (other: Record<string, unknown>) => {
        const known = this.subscriptions.get(sub);
        if (!known) return;
        known.args = other;
        this.send({ t: "sub", sub, topic, hz, args: other });
      },
      end: () => {
        if (this.subscriptions.delete(sub)) this.send({ t: "unsub", sub });
      },
    };
  }

  private heard(data: string | ArrayBuffer): void {
    this.lastWord = performance.now();
    this.listener.heard();
    if (typeof data !== "string") {
      const frame = readFrame(data);
      this.deliver(frame.sub, frame.seq, frame.time, null, frame);
      return;
    }
    const message = JSON.parse(data) as FromStudio;
    switch (message.t) {
      case "hello": {
        this.tries = 0;
        this.greeted = true;
        this.listener.hello(message);
        const known = this.listener.known();
        const same = known !== null && known.boot === message.boot;
        this.send({ t: "join", ...(same ? known : {}) });
        for (const [sub, one] of this.subscriptions) {
          this.send({ t: "sub", sub, topic: one.topic, hz: one.hz, args: one.args });
        }
        this.listener.opened();
        break;
      }
      case "ack":
        this.settle(message.id)?.resolve(message.rev);
        break;
      case "answer":
        this.settle(message.id)?.resolve(message.value);
        break;
      case "reject":
        this.settle(message.id)?.reject(new Refusal(message));
        break;
      case "data":
        this.deliver(message.sub, message.seq, message.time, message.value, null);
        break;
      case "gone": {
        const gone = this.subscriptions.get(message.sub);
        this.subscriptions.delete(message.sub);
        gone?.gone?.(message.message);
        break;
      }
      default:
        this.listener.message(message);
    }
  }

  private settle(id: number): Waiting | undefined {
    const waiting = this.waiting.get(id);
    this.waiting.delete(id);
    return waiting;
  }

  /** The credit goes back after the frame is on the screen, so that a slow page is not sent what it cannot show. */
  private deliver(sub: number, seq: number, time: number, value: unknown, frame: Frame | null): void {
    this.subscriptions.get(sub)?.handle(value, time, frame);
    requestAnimationFrame(() => this.send({ t: "painted", sub, seq }));
  }

  private closed(event: CloseEvent): void {
    this.forget();
    this.listener.closed(event.code, event.reason);
    if (event.code === 4401 || event.code === 1008) return;
    this.timer = window.setTimeout(() => this.connect(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
  }
}
