/** What the loop sends (extensions/live/state.py and loop.py). SI units; legs LF LM LR RF RM RR. */

import type { Ground, PackedSurface, Robot } from "../../../cosim/viewer/src/types";

export interface Frame {
  readonly time: number;
  readonly position: readonly number[];
  /** w x y z */
  readonly quaternion: readonly number[];
  readonly angle: readonly number[];
  readonly contact: readonly number[];
  /** [body weights] three entries a foot */
  readonly force: readonly number[];
  /** [N m] the largest of all servos */
  readonly torque: number;
  readonly slip: readonly number[];
  /** forward, left [m/s], turn [rad/s], in the torso's axes */
  readonly speed: readonly number[];
  readonly command: readonly number[];
  /** roll and pitch [rad] */
  readonly tilt: readonly number[];
  /** [N] world axes */
  readonly push: readonly number[];
  readonly factor: number;
  readonly steps: number;
  readonly misses: number;
  readonly worst: number;
  /** Wall time that was not simulated [s]. */
  readonly skipped: number;
  /** How often the robot was placed: its pose jumps when this changes. */
  readonly placed: number;
  /** Time since the robot was placed [s]. */
  readonly seconds: number;
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
  readonly refused: Readonly<Record<string, string>>;
  readonly gaits: readonly string[];
  readonly grounds: readonly { readonly name: string; readonly about: string }[];
}
