import { Quaternion, Vector3 } from "three";
import { type Connection, Listeners } from "./link";
import type { Limits, Settings, Setup, World } from "./messages";
import type { Robot } from "./robot";

const LONGEST = 1; // s    made up at once; a longer gap, as of a hidden page, is skipped
const MOST_WEIGHTS = 3; // body weights    largest push

/** The plan of a change of gait (extensions/live/gait_change.py); times since the request [s]. */
interface GaitChange {
  readonly limits: Limits;
  readonly begin: number;
  readonly settled: number;
  readonly end: number;
}

interface Gait {
  /** Pattern, period, duty, step height, touch-down speed. */
  readonly gait: readonly number[];
  readonly limits: Limits;
  readonly changes: Readonly<Record<string, GaitChange>>;
}

/** What the page holds (extensions/live/static_page.py). */
export interface StaticSetup extends Setup {
  readonly world: World;
  readonly first: Settings;
  /** hxControl by name. */
  readonly numbers: Readonly<Record<string, number>>;
  readonly walks: Readonly<Record<string, Gait>>;
}

/** Steps the robot in this page in real time, and answers the page as a server does. */
export class LocalLoop extends Listeners implements Connection {
  readonly state = "open";
  private settings: Settings;
  private wanted: Settings;
  private limits: Limits;
  private gait: string; // of the controller
  private change: { readonly plan: GaitChange; readonly since: number } | undefined;
  private drive = { forward: 0, left: 0, turn: 0, height: 0, speed: 1 };
  private push = [0, 0, 0];
  private paused = false;
  private fault = "";
  private last = performance.now();
  private due = 0; // s    of wall time that is not yet simulated
  private steps = 0;
  private placed = 0;
  private skipped = 0;

  constructor(
    private readonly robot: Robot,
    private readonly setup: StaticSetup,
  ) {
    super();
    this.settings = this.wanted = setup.first;
    this.gait = setup.first.gait;
    this.limits = setup.walks[this.gait].limits;
    setTimeout(() => this.begin());
  }

  watchState(watcher: (state: "open") => void): void {
    watcher(this.state);
  }

  /** Does what a message of the page asks for. */
  send(message: Record<string, unknown>): void {
    this.attempt(() => {
      if (message.type === "drive") Object.assign(this.drive, message);
      else if (message.type === "push")
        this.setPush(["x", "y", "z"].map((k) => Number(message[k])));
      else if (message.type === "set") this.set(message.key as keyof Settings, message.value);
      else if (message.action === "place") this.place();
      else this.paused = message.action === "pause";
      if (message.type === "set" || message.type === "do") this.tellStatus();
    });
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
      this.fault = String(error);
      this.tellStatus();
    }
  }

  /** Simulates the time that has passed since the last picture. */
  private advance(): void {
    const now = performance.now();
    const passed = (now - this.last) / 1000;
    this.last = now;
    if (this.paused || this.fault) return;
    if (passed > LONGEST) this.skipped += passed;
    else this.due += passed;
    const { step } = this.setup.world;
    const count = Math.floor(this.due / step);
    if (count === 0) return;
    this.due -= count * step;
    this.robot.write("command", this.command());
    this.robot.write("push", this.push);
    this.robot.do("advance", count);
    this.steps += count;
    this.followChange();
    this.tellFrame();
  }

  private place(): void {
    this.settings = this.wanted;
    const { control, gait, friction } = this.settings;
    const walk = this.setup.walks[gait];
    this.robot.write("gait", walk.gait);
    this.robot.do("start", this.setup.numbers[control], friction);
    [this.gait, this.limits, this.change, this.push] = [gait, walk.limits, undefined, [0, 0, 0]];
    [this.fault, this.paused, this.due, this.last] = ["", false, 0, performance.now()];
    this.placed += 1;
    this.tellStatus();
    this.tellFrame();
  }

  private set(key: keyof Settings, value: unknown): void {
    if (this.wanted[key] === value) return;
    this.wanted = { ...this.wanted, [key]: value };
    if (key === "gait") this.requestGait(String(value));
    else this.settings = { ...this.settings, [key]: value };
    if (key === "friction") this.robot.do("change_friction", Number(value));
    if (key === "control") this.robot.do("change_control", this.setup.numbers[String(value)]);
  }

  private requestGait(gait: string): void {
    const plan = this.setup.walks[this.gait].changes[gait];
    this.change = { plan, since: this.robot.state.time[0] };
    this.limits = plan.limits;
  }

  /** Does what is due of a change of gait. */
  private followChange(): void {
    if (!this.change) return;
    const { plan, since } = this.change;
    const { gait } = this.wanted;
    const passed = this.robot.state.time[0] - since;
    if (passed >= plan.begin && this.gait !== gait) {
      this.robot.write("gait", this.setup.walks[gait].gait);
      this.robot.do("change_gait");
      this.gait = gait;
    }
    if (passed >= plan.settled) this.settings = this.wanted;
    if (passed >= plan.end) [this.limits, this.change] = [this.setup.walks[gait].limits, undefined];
    this.tellStatus();
  }

  /** Returns forward, left [m/s], turn [rad/s], height [m], which share the reach of the legs. */
  private command(): number[] {
    const { forward, left, turn, height, speed } = this.drive;
    const { limits } = this;
    const shares = [forward, left, turn].map((share) => share * speed);
    const sum = shares.reduce((total, share) => total + Math.abs(share), 0);
    const room = Math.min((1 - Math.abs(height)) / Math.max(sum, 1e-9), 1);
    const largest = [limits.vx, limits.vy, limits.yaw_rate];
    const rise = height * (height > 0 ? limits.up : limits.down);
    return [...largest.map((most, k) => most * room * shares[k]), rise];
  }

  private setPush(force: readonly number[]): void {
    const most = MOST_WEIGHTS * this.setup.world.weight;
    const share = Math.min(most / Math.max(Math.hypot(...force), 1e-9), 1);
    this.push = force.map((part) => share * part);
  }

  private tellFrame(): void {
    const { setup, steps, skipped, placed } = this;
    const { state } = this.robot;
    const [w, x, y, z] = state.quaternion;
    const own = (v: readonly number[]) =>
      new Vector3(...v).applyQuaternion(new Quaternion(-x, -y, -z, w));
    const [motion, rate] = [own(state.velocity), own(state.rate)];
    this.tell("frame", {
      ...state,
      time: state.time[0],
      seconds: state.time[0],
      contact: state.slip.map((_, k) => Number(state.force[3 * k + 2] !== 0)),
      force: state.force.map((part) => part / setup.world.weight),
      torque: Math.max(...state.torque.map(Math.abs)),
      speed: [motion.x, motion.y, rate.z],
      command: this.command(),
      factor: 1,
      steps,
      misses: 0,
      worst: 0,
      skipped,
      placed,
    });
  }

  private tellStatus(): void {
    const { settings, wanted, limits, fault, paused } = this;
    const stopped = fault !== "";
    this.tell("status", {
      settings,
      wanted,
      limits,
      fault,
      stopped,
      paused,
      recording: false,
      recorded: false,
    });
  }
}
