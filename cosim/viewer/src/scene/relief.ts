import { Vector3 } from "three";
import type { Ground } from "../types";
import type { Surface } from "./surface";

/** The ground of a run, a plane or a surface: its height and normal at each position. */
export class Relief {
  constructor(
    readonly plane: Ground,
    readonly surface?: Surface,
  ) {}

  /** Returns the world height of the ground at a position [m]. */
  height(x: number, y: number): number {
    const { height, rise, heading } = this.plane;
    if (this.surface) return height + this.surface.at(x, y).height;
    return height + rise * (x * Math.cos(heading) + y * Math.sin(heading));
  }

  /** Returns the unit normal of the ground at a position [m]; upward on a block. */
  normal(x: number, y: number): Vector3 {
    if (!this.surface) return planeNormal(this.plane);
    const { slopeX, slopeY } = this.surface.at(x, y);
    return new Vector3(-slopeX, -slopeY, 1).normalize();
  }

  /**
   * Returns where the mark of a foot is drawn: on the ground below its centre. A foot beside a wall
   * or on an edge leaves its mark at its own lowest point.
   */
  mark(foot: Vector3, radius: number): Vector3 {
    const height = this.height(foot.x, foot.y);
    const sole = foot.z - radius;
    const beside = this.surface && !this.surface.smooth && Math.abs(height - sole) > 0.5 * radius;
    return new Vector3(foot.x, foot.y, beside ? sole : height);
  }
}

/** Returns the unit normal of a plane. */
export function planeNormal(ground: Ground): Vector3 {
  return new Vector3(
    -ground.rise * Math.cos(ground.heading),
    -ground.rise * Math.sin(ground.heading),
    1,
  ).normalize();
}
