import { bodyCommand } from "./drive";
import { type Connection, Listeners } from "./link";
import type { Settings, StaticSetup } from "./messages";

const LONGEST = 1; // s    made up at once; a longer gap, as of a hidden page, is skipped
/** Sizes of the parts of the module's row of values (extensions/live/wasm/robot.c). */
const SIZES = {
  ...{ time: 1, angle: 18, jointSpeed: 18, torque: 18, force: 18, slip: 6 },
  ...{ position: 3, quaternion: 4, attitude: 3, velocity: 3, rate: 3, joints: 54, push: 3 },
};

/** Steps the robot in this page in real time, and answers the page as a server does. */
export class LocalLoop extends Listeners implements Connection {
  readonly state = "open";
  private readonly status;
  private plan: [number, () => void][] = []; // s    what is due of a change of gait
  private readonly input = { forward: 0, left: 0, turn: 0, height: 0, speed: 1, x: 0, y: 0, z: 0 };
  private last = performance.now();
  private due = 0; // s    of wall time that is not yet simulated
  private placed = 0;

  /** `module`: exports of the robot with its controller. */
  constructor(
    private readonly module: WebAssembly.Exports,
    private readonly setup: StaticSetup,
  ) {
    super();
    const { first: settings, walks } = setup;
    const flags = { stopped: true, paused: true, recording: false, recorded: false, fault: "" };
    this.status = { ...flags, settings, wanted: settings, limits: walks[settings.gait].limits };
    setTimeout(() => {
      this.emit("world", setup.world);
      this.attempt(() => {
        this.call("_initialize");
        this.do("create");
        this.place();
      });
      this.follow();
    });
  }

  watchState = (watcher: (state: "open") => void): void => watcher(this.state);

  /** Does what a message of the page asks for. */
  send({ type, key, value, action, ...input }: Record<string, unknown>): void {
    this.attempt(() => {
      if (type === "set") this.set(key as keyof Settings, value as string & number);
      else if (type === "leg") this.do("leg", input.leg as number);
      else if (action === "place") this.place();
      else if (type === "do") this.status.paused = action === "pause";
      else Object.assign(this.input, input);
    });
  }

  /** Does something; an error of any kind stops the robot, and the page shows it. */
  private attempt(act: () => void): void {
    const before = JSON.stringify(this.status);
    try {
      act();
    } catch (error) {
      this.status.fault = String(error);
    }
    if (JSON.stringify(this.status) !== before) this.emit("status", { ...this.status });
  }

  /** Simulates the time that has passed since the last picture. */
  private follow(now = this.last): void {
    requestAnimationFrame((next) => this.follow(next));
    const passed = (now - this.last) / 1000;
    this.last = now;
    if (this.status.paused || this.status.fault || passed > LONGEST) return;
    this.due += passed;
    const count = Math.floor(this.due / this.setup.world.step);
    this.due -= count * this.setup.world.step;
    if (count > 0) this.attempt(() => this.advance(count));
  }

  private advance(count: number): void {
    const { x, y, z } = this.input;
    this.do("advance", count, ...bodyCommand(this.input, this.status.limits), x, y, z);
    const [time] = this.row().time;
    while (this.plan.length > 0 && time >= this.plan[0][0]) this.plan.shift()![1]();
    this.emitFrame();
  }

  private place(): void {
    const { setup, status } = this;
    const { control, gait, friction } = status.wanted;
    const { gait: timing, limits } = setup.walks[gait];
    this.do("gait", ...timing);
    this.do("start", setup.numbers[control], friction);
    Object.assign(status, { settings: status.wanted, limits, fault: "", paused: false });
    [this.plan, this.due, this.placed] = [[], 0, this.placed + 1];
    this.emitFrame();
  }

  private set(key: keyof Settings, value: string & number): void {
    const { status } = this;
    status.wanted = { ...status.wanted, [key]: value };
    if (key === "gait") this.planChange(value);
    else status.settings = { ...status.settings, [key]: value };
    if (key === "friction") this.do("friction", value);
    if (key === "control") this.do("control", this.setup.numbers[value]);
  }

  private planChange(gait: string): void {
    const [status, { walks }] = [this.status, this.setup];
    const { begin, end, limits } = walks[status.settings.gait].changes[gait];
    const [since] = this.row().time;
    const change = () => {
      this.do("gait", ...walks[gait].gait);
      status.settings = { ...status.settings, gait };
    };
    this.plan = [[since + begin, change]];
    this.plan.push([since + end, () => Object.assign(status, { limits: walks[gait].limits })]);
    status.limits = limits;
  }

  private emitFrame(): void {
    const row = this.row();
    const force = row.force.map((part) => part / this.setup.world.weight);
    const command = bodyCommand(this.input, this.status.limits);
    this.emit("frame", { ...row, time: row.time[0], force, command, placed: this.placed });
  }

  /** Returns the module's row of values. SI units; legs LF LM LR RF RM RR. */
  private row(): Record<keyof typeof SIZES, number[]> {
    const { buffer } = this.module.memory as WebAssembly.Memory; // changes when the memory grows
    let place = this.call("hx_page_values");
    const parts = Object.entries(SIZES).map(([name, size]) => {
      const part = new Float64Array(buffer, place, size);
      place += part.byteLength;
      return [name, [...part]];
    });
    return Object.fromEntries(parts);
  }

  /** Calls a function of the module that returns a status. Throws an error for a failure. */
  private do(name: string, ...values: number[]): void {
    const status = this.call(`hx_page_${name}`, ...values);
    if (status !== 0) throw new Error(`${name} has failed with status ${status}`);
  }

  private call(name: string, ...values: number[]): number {
    return (this.module[name] as (...values: number[]) => number)(...values);
  }
}
