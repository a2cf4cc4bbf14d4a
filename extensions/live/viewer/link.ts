import type { Frame, Status, World } from "./messages";

const AGAIN = 1000; // ms    until a lost connection is tried again
const SILENT = 1500; // ms    without a message, after which the loop is said not to answer

export interface Received {
  world: World;
  status: Status;
  frame: Frame;
  note: { text: string };
}

export type Kind = keyof Received;
export type State = "connecting" | "open" | "silent" | "lost" | "refused";

/** What the page needs of a loop, wherever it runs. */
export interface Connection {
  readonly state: State;
  on<K extends Kind>(kind: K, listener: (message: Received[K]) => void): void;
  watchState(watcher: (state: State) => void): void;
  send(message: Record<string, unknown>): void;
}

/** Functions that are called with each message of a kind. */
export class Listeners {
  private readonly lists: { [K in Kind]: ((message: Received[K]) => void)[] } = {
    world: [],
    status: [],
    frame: [],
    note: [],
  };

  on<K extends Kind>(kind: K, listener: (message: Received[K]) => void): void {
    this.lists[kind].push(listener);
  }

  protected emit<K extends Kind>(kind: K, message: Received[K]): void {
    for (const listener of this.lists[kind]) listener(message);
  }
}

/** The socket to the loop, which connects again when the connection is lost. */
export class Link extends Listeners implements Connection {
  private socket: WebSocket | undefined;
  private readonly watchers: ((state: State) => void)[] = [];
  private heard = performance.now();
  state: State = "connecting";

  constructor() {
    super();
    setInterval(() => this.watch(), SILENT / 3);
    this.connect();
  }

  watchState(watcher: (state: State) => void): void {
    this.watchers.push(watcher);
    watcher(this.state);
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
    const message = JSON.parse(text) as Received[Kind] & { readonly type: Kind };
    this.heard = performance.now();
    if (this.state === "silent") this.become("open");
    this.emit(message.type, message);
  }

  /** A loop that is paused is silent as well, which is no fault. */
  private watch(): void {
    const { mode } = document.documentElement.dataset;
    const silent = performance.now() - this.heard > SILENT && mode !== "paused";
    if (this.state === "open" && silent) this.become("silent");
  }

  private become(state: State): void {
    this.state = state;
    for (const watcher of this.watchers) watcher(state);
  }
}
