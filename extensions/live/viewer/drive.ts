import type { Connection } from "./link";

const OFTEN = 40; // ms    between two drives at the most
const RENEW = 150; // ms    between two drives that are the same, while the robot is to move
const GRAIN = 50; // steps of an axis from 0 to 1

export interface Axes {
  readonly forward: number;
  readonly left: number;
  readonly turn: number;
}

export const NONE: Axes = { forward: 0, left: 0, turn: 0 };

/** Adds up what keys, gamepad and touch ask for, and sends it when it changes. */
export class Drive {
  private readonly sources = new Map<string, Axes>();
  private readonly listeners: (() => void)[] = [];
  private sent = JSON.stringify({ ...NONE, height: 0 });
  private at = 0;
  private pace: number;
  private rise = 0;

  constructor(
    private readonly link: Connection,
    speed: number,
  ) {
    this.pace = speed;
    setInterval(() => this.renew(), OFTEN);
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
    this.rise = Math.min(Math.max(value, -1), 1);
    this.changed();
  }

  /** What a source asks for; NONE when it is let go. */
  set(source: string, axes: Axes): void {
    this.sources.set(source, axes);
    this.changed();
  }

  /** The sum of all sources, each axis from -1 to 1. */
  get axes(): Axes {
    const sum = (part: (axes: Axes) => number) => {
      const whole = [...this.sources.values()].reduce((total, one) => total + part(one), 0);
      return Math.round(GRAIN * Math.min(Math.max(whole, -1), 1)) / GRAIN;
    };
    return {
      forward: sum((one) => one.forward),
      left: sum((one) => one.left),
      turn: sum((one) => one.turn),
    };
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
    const { axes } = this;
    const now = performance.now();
    const moves = Object.values(axes).some((axis) => axis !== 0);
    const height = Math.round(GRAIN * this.rise) / GRAIN;
    // the speed alone is no drive: a page that only watches sends nothing
    const text = JSON.stringify({ ...axes, height, ...(moves ? { speed: this.pace } : {}) });
    const due = text !== this.sent || (moves && now - this.at > RENEW);
    if (!due || now - this.at < OFTEN || this.link.state !== "open") return;
    [this.sent, this.at] = [text, now];
    this.link.send({ type: "drive", ...axes, height, speed: this.pace });
  }
}
