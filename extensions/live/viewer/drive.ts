import type { Connection } from "./link";
import type { Limits } from "./messages";

const OFTEN = 40; // ms    between two drives at the most
const RENEW = 150; // ms    between two drives that are the same, while the robot is to move

export interface Axes {
  readonly forward: number;
  readonly left: number;
  readonly turn: number;
}

/** What the reader asks for, as shares of the largest command; `speed` is a factor of the axes. */
interface Asked extends Axes {
  readonly height: number;
  readonly speed: number;
}

/** Returns forward, left [m/s], turn [rad/s], height [m], which share the reach of the legs. */
export function bodyCommand(asked: Asked, limits: Limits): number[] {
  const { forward, left, turn, height, speed } = asked;
  const sum = speed * (Math.abs(forward) + Math.abs(left) + Math.abs(turn));
  const share = speed * Math.min((1 - Math.abs(height)) / Math.max(sum, 1e-9), 1);
  const rise = height * (height > 0 ? limits.up : limits.down);
  const { vx, vy, yaw_rate } = limits;
  return [share * forward * vx, share * left * vy, share * turn * yaw_rate, rise];
}

const NONE: Axes = { forward: 0, left: 0, turn: 0 };

/** What the reader asks for, as shares of the largest command; it is sent when it changes. */
export class Drive {
  private readonly listeners: (() => void)[] = [];
  private moves = NONE;
  private sent = JSON.stringify({ ...NONE, height: 0 });
  private at = 0;
  private pace = 0.3;
  private rise = 0;

  constructor(private readonly link: Connection) {
    setInterval(() => this.renew(), OFTEN);
  }

  /** Sets forward, left and turn, each from -1 to 1. */
  set axes(axes: Axes) {
    this.moves = axes;
    this.changed();
  }

  get speed(): number {
    return this.pace;
  }

  set speed(value: number) {
    this.pace = Math.min(Math.max(value, 0.05), 1);
    this.changed();
  }

  get height(): number {
    return this.rise;
  }

  set height(value: number) {
    this.rise = Math.min(Math.max(Math.round(100 * value) / 100, -1), 1);
    this.changed();
  }

  listen(listener: () => void): void {
    this.listeners.push(listener);
  }

  private changed(): void {
    for (const listener of this.listeners) listener();
    this.renew();
  }

  /** Sends the drive if it is a new one, or if the robot is to move on. */
  private renew(): void {
    const now = performance.now();
    const moves = Object.values(this.moves).some((axis) => axis !== 0);
    // the speed alone is no drive: a page that only watches sends nothing
    const shown = { ...this.moves, height: this.rise, ...(moves ? { speed: this.pace } : {}) };
    const text = JSON.stringify(shown);
    const due = text !== this.sent || (moves && now - this.at > RENEW);
    if (!due || now - this.at < OFTEN || this.link.state !== "open") return;
    [this.sent, this.at] = [text, now];
    this.link.send({ type: "drive", ...this.moves, height: this.rise, speed: this.pace });
  }
}

/** Keys that move the robot while they are pressed, by their place on the keyboard. */
const MOVES: Record<string, readonly ["forward" | "left" | "turn", number]> = {
  KeyW: ["forward", 1],
  ArrowUp: ["forward", 1],
  KeyS: ["forward", -1],
  ArrowDown: ["forward", -1],
  KeyA: ["turn", 1],
  ArrowLeft: ["turn", 1],
  KeyD: ["turn", -1],
  ArrowRight: ["turn", -1],
  KeyQ: ["left", 1],
  KeyE: ["left", -1],
};

/** Listens to the keyboard; `actions` are done once at a key's press. */
export class Keys {
  private readonly pressed = new Set<string>();

  constructor(
    private readonly drive: Drive,
    private readonly actions: Readonly<Record<string, () => void>>,
  ) {
    document.addEventListener("keydown", (event) => this.keydown(event));
    document.addEventListener("keyup", (event) => this.release(event.code));
    // a key that is let go in another window gives no event
    window.addEventListener("blur", () => this.releaseAll());
    document.addEventListener("visibilitychange", () => document.hidden && this.releaseAll());
  }

  /** Presses a key of the page's own pad. */
  press(code: string): void {
    this.pressed.add(code);
    this.apply();
  }

  release(code: string): void {
    if (this.pressed.delete(code)) this.apply();
  }

  private keydown(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || usesKeys(event)) return;
    if (MOVES[event.code]) {
      event.preventDefault();
      if (!event.repeat) this.press(event.code);
      return;
    }
    const act = this.actions[event.code] ?? this.actions[event.key];
    if (!act || (event.repeat && event.code !== "KeyR" && event.code !== "KeyF")) return;
    event.preventDefault();
    act();
  }

  private releaseAll(): void {
    this.pressed.clear();
    this.apply();
  }

  private apply(): void {
    const axes = { forward: 0, left: 0, turn: 0 };
    for (const code of this.pressed) {
      const [axis, sign] = MOVES[code];
      axes[axis] = Math.min(Math.max(axes[axis] + sign, -1), 1);
    }
    this.drive.axes = axes;
    for (const button of document.querySelectorAll<HTMLElement>("[data-key]"))
      button.classList.toggle("pressed", this.isPressed(button.dataset.key!));
  }

  /** Whether a key or its twin is pressed. */
  private isPressed(code: string): boolean {
    const [axis, sign] = MOVES[code];
    return [...this.pressed].some((one) => MOVES[one][0] === axis && MOVES[one][1] === sign);
  }
}

/** Whether the focused element uses the key itself. */
function usesKeys(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  if (document.querySelector("dialog[open]")) return true;
  if (target.matches("select, input:not([type=range]), textarea")) return true;
  if (target.matches("input[type=range]")) return event.key.startsWith("Arrow");
  return (event.key === " " || event.key === "Enter") && target.matches("button, a, summary");
}
