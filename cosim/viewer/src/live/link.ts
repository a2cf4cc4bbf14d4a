import type { Frame, Status, World } from "./messages";

const AGAIN = 1000; // ms    until a lost connection is tried again
const SILENT = 1500; // ms    without a frame, after which the loop is said not to answer
const PING = 500; // ms    between two requests for an echo

export interface Received {
  hello: { client: number };
  pages: { count: number };
  world: World;
  status: Status;
  frame: Frame;
  refused: { reason: string };
}

type Kind = keyof Received;
export type State = "connecting" | "open" | "silent" | "lost" | "refused";

/** The socket to the loop: connects, connects again, and measures the latency of an echo. */
export class Link {
  private socket: WebSocket | undefined;
  private readonly listeners: { [K in Kind]?: ((message: Received[K]) => void)[] } = {};
  private readonly watchers: ((state: State) => void)[] = [];
  private known: State = "connecting";
  private heard = 0;
  client = 0;
  /** From a message to the first frame that shows its effect, smoothed [ms]. */
  latency: number | undefined;

  constructor() {
    this.on("hello", ({ client }) => {
      this.client = client;
    });
    this.on("frame", (frame) => this.noteEcho(frame));
    setInterval(() => this.watch(), PING);
    this.connect();
  }

  get state(): State {
    return this.known;
  }

  on<K extends Kind>(kind: K, listener: (message: Received[K]) => void): void {
    const list = (this.listeners[kind] ?? []) as ((message: Received[K]) => void)[];
    this.listeners[kind] = [...list, listener] as (typeof this.listeners)[K];
  }

  watchState(watcher: (state: State) => void): void {
    this.watchers.push(watcher);
    watcher(this.known);
  }

  /** Sends a message, or drops it while there is no connection. */
  send(message: Record<string, unknown>): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private connect(): void {
    const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
    this.socket = socket;
    socket.addEventListener("open", () => this.become("open"));
    socket.addEventListener("message", ({ data }) => this.receive(String(data)));
    socket.addEventListener("close", ({ code }) => {
      if (code === 1008) {
        this.become("refused");
        return;
      }
      this.become("lost");
      setTimeout(() => this.connect(), AGAIN);
    });
  }

  private receive(text: string): void {
    const message = JSON.parse(text) as { type: Kind };
    this.heard = performance.now();
    if (this.known === "silent") this.become("open");
    const list = this.listeners[message.type] as ((message: unknown) => void)[] | undefined;
    for (const listener of list ?? []) listener(message);
  }

  private noteEcho(frame: Frame): void {
    const stamp = frame.echo[String(this.client)];
    if (!stamp) return;
    const took = performance.now() - stamp;
    this.latency = this.latency === undefined ? took : 0.8 * this.latency + 0.2 * took;
  }

  private watch(): void {
    this.send({ type: "ping", stamp: performance.now() });
    if (this.known === "open" && this.heard > 0 && performance.now() - this.heard > SILENT)
      this.become("silent");
  }

  private become(state: State): void {
    this.known = state;
    for (const watcher of this.watchers) watcher(state);
  }
}
