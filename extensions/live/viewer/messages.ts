/** What the loop sends (extensions/live/page.py and loop.py). SI units; legs LF LM LR RF RM RR. */

import type { Ground, PackedSurface, Robot } from "../../../cosim/viewer/src/types";

/** How a loop behind a server follows wall time. */
export interface Lateness {
  /** Simulated time over wall time of the last second; 0 at the start. */
  readonly factor: number;
  /** Wall time that was not simulated [s]. */
  readonly skipped: number;
}

export interface Frame {
  readonly time: number;
  readonly position: readonly number[];
  /** w x y z */
  readonly quaternion: readonly number[];
  /** roll, pitch, yaw [rad] */
  readonly attitude: readonly number[];
  readonly velocity: readonly number[];
  /** Angular velocity, world axes. */
  readonly rate: readonly number[];
  readonly angle: readonly number[];
  /** [body weights] three entries a foot */
  readonly force: readonly number[];
  readonly slip: readonly number[];
  readonly command: readonly number[];
  /** [N] world axes */
  readonly push: readonly number[];
  /** How often the robot was placed: its pose jumps when this changes. */
  readonly placed: number;
  readonly late?: Lateness;
}

/** Returns the speed forward, to the left [m/s] and of the turn [rad/s]. */
export function speedOf({ velocity: [x, y], attitude, rate }: Frame): [number, number, number] {
  const [cos, sin] = [Math.cos(attitude[2]), Math.sin(attitude[2])];
  return [cos * x + sin * y, cos * y - sin * x, rate[2]];
}

/** Returns the force on each foot [body weights]; it is 0 in the air. */
export function footForces({ force, slip }: Frame): number[][] {
  return slip.map((_, k) => force.slice(3 * k, 3 * k + 3));
}

export interface World {
  readonly robot: Robot;
  readonly ground: Ground;
  readonly surfaces: readonly PackedSurface[];
  /** [N] */
  readonly weight: number;
  readonly step: number;
}

export interface Settings {
  readonly control: string;
  readonly gait: string;
  readonly friction: number;
  readonly ground: string;
}

export interface Limits {
  readonly vx: number;
  readonly vy: number;
  readonly yaw_rate: number;
  readonly up: number;
  readonly down: number;
}

export interface Status {
  readonly settings: Settings;
  /** That hold when all changes are made. */
  readonly wanted: Settings;
  readonly limits: Limits;
  readonly fault: string;
  readonly stopped: boolean;
  readonly paused: boolean;
  readonly recording: boolean;
  readonly recorded: boolean;
}

/** What the page holds (extensions/live/page.py). */
export interface Setup {
  readonly controls: readonly string[];
  /** One line on each control. */
  readonly abouts: Readonly<Record<string, string>>;
  readonly refused: Readonly<Record<string, string>>;
  readonly gaits: readonly string[];
  readonly grounds: readonly { readonly name: string; readonly about: string }[];
}

/** What a page without a server holds besides (extensions/live/static_page.py). */
export interface StaticSetup extends Setup {
  readonly world: World;
  readonly first: Settings;
  /** hxControl by name. */
  readonly numbers: Record<string, number>;
  readonly walks: Record<string, GaitChanges>;
}

interface GaitChanges {
  /** Pattern, period, duty, step height, touch-down speed. */
  readonly gait: number[];
  readonly limits: Limits;
  /** Plans of changes to other gaits (extensions/live/settings.py); times since the request. */
  readonly changes: Record<string, { begin: number; end: number; limits: Limits }>;
}
