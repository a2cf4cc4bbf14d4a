import type { Connection, Kind, Received, State } from "../live/link";
import type { Frame, Limits, Settings, Setup, Status, World } from "../live/messages";
import { type Walk, type Walker, WalkerError } from "./walker";

const LONGEST = 1; // s    made up at once; a longer gap, as of a hidden page, is skipped
const SPAN = 1000; // ms    over which the real-time factor is measured
const MOST_WEIGHTS = 3; // body weights    largest push

/** What the page holds (extensions/live/static_page.py). */
export interface StaticSetup extends Setup {
  readonly world: World;
  readonly first: Settings;
  /** hxControl by name. */
  readonly numbers: Readonly<Record<string, number>>;
  /** Pattern, period, duty, step height, touch-down speed, and the largest commands, by gait. */
  readonly walks: Readonly<
    Record<string, { readonly gait: readonly number[]; readonly limits: Limits }>
  >;
  /** Part of the speeds that both gaits allow, for a change between them. */
  readonly share: number;
}

interface Drive {
  readonly forward: number;
  readonly left: number;
  readonly turn: number;
  readonly height: number;
  readonly speed: number;
}

/** Steps the robot in this page in real time, and answers the page as the loop of a server does. */
export class LocalLoop implements Connection {
  readonly client = 1;
  readonly latency = undefined;
  readonly state: State = "open";
  private readonly listeners: { [K in Kind]?: ((message: Received[K]) => void)[] } = {};
  private settings: Settings;
  private limits: Limits;
  private wanted: Settings | null = null;
  private drive: Drive = { forward: 0, left: 0, turn: 0, height: 0, speed: 1 };
  private push: readonly number[] = [0, 0, 0];
  private paused = false;
  private fault = "";
  private last = performance.now();
  private owed = 0; // s    of wall time that is not yet simulated
  private steps = 0;
  private placed = 0;
  private gaps = 0;
  private skipped = 0;
  private paces: [number, number][] = [];

  constructor(
    private readonly walker: Walker,
    private readonly setup: StaticSetup,
  ) {
    this.settings = setup.first;
    this.limits = setup.walks[setup.first.gait].limits;
    setTimeout(() => this.begin());
  }

  on<K extends Kind>(kind: K, listener: (message: Received[K]) => void): void {
    const list = (this.listeners[kind] ?? []) as ((message: Received[K]) => void)[];
    this.listeners[kind] = [...list, listener] as (typeof this.listeners)[K];
  }

  watchState(watcher: (state: State) => void): void {
    watcher(this.state);
  }

  /** Does what a message asks for; those of the page are the only ones. */
  send(message: Record<string, unknown>): void {
    this.attempt(() => this.answer(message));
  }

  private answer(message: Record<string, unknown>): void {
    if (message.type === "drive") {
      this.drive = message as unknown as Drive;
      this.command();
    } else if (message.type === "push") this.setPush(message.force as number[]);
    else if (message.type === "set")
      this.change(message.key as keyof Settings, message.value as string | number);
    else if (message.type === "do") this.act(message.action as string);
  }

  private begin(): void {
    this.attempt(() => {
      this.tell("world", this.setup.world);
      this.place();
    });
    const picture = (): void => {
      requestAnimationFrame(picture);
      this.attempt(() => this.advance());
    };
    requestAnimationFrame(picture);
  }

  /** Does something; an error of any kind stops the robot, and the page shows it. */
  private attempt(act: () => void): void {
    try {
      act();
    } catch (error) {
      this.fault = error instanceof WalkerError ? error.message : String(error);
      this.tellStatus();
    }
  }

  /** Simulates the time that has passed since the last picture. */
  private advance(): void {
    const now = performance.now();
    const passed = (now - this.last) / 1000;
    this.last = now;
    if (this.paused || this.fault) return;
    if (passed > LONGEST) {
      this.gaps += 1;
      this.skipped += passed;
    } else this.owed += passed;
    const due = Math.floor(this.owed / this.walker.step);
    if (due === 0) return;
    this.owed -= due * this.walker.step;
    this.walker.advance(due);
    this.steps += due;
    this.paces.push([now, this.steps]);
    while (now - this.paces[0][0] > SPAN) this.paces.shift();
    this.tellFrame();
  }

  private tellFrame(): void {
    const state = this.walker.state;
    const { weight } = this.setup.world;
    const [w, x, y, z] = state.quaternion;
    const own = (v: readonly number[]) => turned([w, -x, -y, -z], v);
    const [forward, left] = own(state.velocity);
    this.followChange(state.changing[0]);
    const frame: Frame = {
      ...state,
      time: state.time[0],
      force: state.force.map((part) => part / weight),
      torque: state.torque[0],
      speed: [forward, left, own(state.rate)[2]],
      command: this.asked(),
      tilt: [
        Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        Math.asin(Math.min(Math.max(2 * (w * y - z * x), -1), 1)),
      ],
      push: this.push,
      factor: this.factor(),
      steps: this.steps,
      misses: 0,
      worst: 0,
      gaps: this.gaps,
      skipped: this.skipped,
      placed: this.placed,
      driver: this.client,
      seconds: state.time[0],
      echo: {},
    };
    this.tell("frame", frame);
  }

  /** Notes which settings and limits hold; changing: as in hxFrame. */
  private followChange(changing: number): void {
    if (changing === 1) return;
    const { limits } = this.setup.walks[(this.wanted ?? this.settings).gait];
    if (!this.wanted && (changing === 2 || this.limits === limits)) return;
    if (this.wanted) [this.settings, this.wanted] = [this.wanted, null];
    if (changing === 0) this.setLimits(limits);
    this.tellStatus();
  }

  private setLimits(limits: Limits): void {
    this.limits = limits;
    this.command();
  }

  /** Returns the speeds for a change from one gait to another (extensions/live/gait_change.py). */
  private slowed(gait: string, next: string): Limits {
    const [a, b] = [gait, next].map((name) => this.setup.walks[name].limits);
    const { share } = this.setup;
    const least = (key: "vx" | "vy" | "yaw_rate") =>
      Math.min(share * Math.min(a[key], b[key]), this.limits[key]);
    return { ...this.limits, vx: least("vx"), vy: least("vy"), yaw_rate: least("yaw_rate") };
  }

  /** Simulated time over wall time of the last second. */
  private factor(): number {
    const [[then, before], [now, after]] = [this.paces[0], this.paces[this.paces.length - 1]];
    return now > then ? ((after - before) * this.walker.step * 1000) / (now - then) : 1;
  }

  /** Returns forward, left [m/s], turn [rad/s], height [m], which share the reach of the legs. */
  private asked(): number[] {
    const { forward, left, turn, height, speed } = this.drive;
    const { limits } = this;
    const shares = [forward, left, turn].map((share) => share * speed);
    const sum = shares.reduce((total, share) => total + Math.abs(share), 0);
    const room = Math.min((1 - Math.abs(height)) / Math.max(sum, 1e-9), 1);
    const velocity = [limits.vx, limits.vy, limits.yaw_rate];
    const rise = height * (height > 0 ? limits.up : limits.down);
    return [...velocity.map((most, k) => most * room * shares[k]), rise];
  }

  private command(): void {
    const [forward, left, turn, height] = this.asked();
    this.walker.command(forward, left, turn, height);
  }

  private setPush(force: readonly number[]): void {
    const most = MOST_WEIGHTS * this.setup.world.weight;
    const share = Math.min(most / Math.max(Math.hypot(...force), 1e-9), 1);
    this.push = force.map((part) => share * part);
    this.walker.push(this.push[0], this.push[1], this.push[2]);
  }

  private change(key: keyof Settings, value: string | number): void {
    const next = { ...(this.wanted ?? this.settings), [key]: value };
    if (key === "friction") {
      this.walker.setFriction(value as number);
      this.settings = { ...this.settings, friction: value as number };
      if (this.wanted) this.wanted = next;
    } else if (key === "control") {
      this.walker.change(this.walkOf(next));
      this.settings = { ...this.settings, control: next.control };
      if (this.wanted) this.wanted = next;
    } else if (key === "gait") {
      const before = (this.wanted ?? this.settings).gait;
      this.wanted = next;
      this.walker.change(this.walkOf(next));
      this.setLimits(this.slowed(before, next.gait));
    }
    this.tellStatus();
  }

  private act(action: string): void {
    if (action === "place") {
      this.place();
      return;
    }
    if (action === "pause" || action === "resume") this.paused = action === "pause";
    this.last = performance.now();
    this.tellStatus();
  }

  private place(): void {
    this.settings = this.wanted ?? this.settings;
    this.wanted = null;
    this.walker.start(this.walkOf(this.settings), this.settings.friction);
    this.setPush([0, 0, 0]);
    this.setLimits(this.setup.walks[this.settings.gait].limits);
    [this.fault, this.paused, this.owed] = ["", false, 0];
    this.placed += 1;
    this.paces = [[performance.now(), this.steps]];
    this.tellStatus();
    this.tellFrame();
  }

  private walkOf({ control, gait }: Settings): Walk {
    return [this.setup.numbers[control], ...this.setup.walks[gait].gait] as unknown as Walk;
  }

  private tellStatus(): void {
    const status: Status = {
      settings: this.settings,
      wanted: this.wanted,
      limits: this.limits,
      fault: this.fault,
      stopped: this.fault !== "",
      paused: this.paused,
      mode: "free",
      recorded: false,
      notes: [],
    };
    this.tell("status", status);
  }

  private tell<K extends Kind>(kind: K, message: Received[K]): void {
    const list = (this.listeners[kind] ?? []) as ((message: Received[K]) => void)[];
    for (const listener of list) listener(message);
  }
}

/** Returns a vector turned by a quaternion w x y z. */
function turned(
  [w, x, y, z]: readonly number[],
  [a, b, c]: readonly number[],
): [number, number, number] {
  const [p, q, r] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p];
}
