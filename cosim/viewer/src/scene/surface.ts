import { Vector3 } from "three";
import { unpack } from "../recording";
import type { Ground, Material, PackedSurface } from "../types";

/** Height [m] of a smooth surface and its slopes along x and y. */
export interface Place {
  readonly height: number;
  readonly slopeX: number;
  readonly slopeY: number;
}

/**
 * A grid of heights: samples of a smooth surface, or blocks with flat tops. Beyond the grid the
 * height of its border goes on.
 */
export class Surface {
  readonly smooth: boolean;
  readonly rows: number;
  readonly columns: number;
  readonly x0: number;
  readonly y0: number;
  readonly cell: number;
  readonly materials: readonly Material[];

  /** height: [m] by rows; material: of each sample or block; empty: all are 0. */
  constructor(
    packed: PackedSurface,
    readonly height: Float32Array,
    readonly material: Uint8Array,
  ) {
    this.smooth = packed.kind === "smooth";
    ({ across: this.columns, materials: this.materials } = packed);
    this.rows = packed.rows / packed.across;
    ({ x0: this.x0, y0: this.y0, cell: this.cell } = packed);
  }

  /** Returns the least and the largest height [m]. */
  get range(): readonly [number, number] {
    let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
    for (const value of this.height) [low, high] = [Math.min(low, value), Math.max(high, value)];
    return [low, high];
  }

  /** Returns height and slopes at a position [m]. */
  at(x: number, y: number): Place {
    const across = (x - this.x0) / this.cell;
    const up = (y - this.y0) / this.cell;
    if (this.smooth) return this.bilinear(across, up);
    const column = clamp(Math.floor(across), 0, this.columns - 1);
    const row = clamp(Math.floor(up), 0, this.rows - 1);
    return { height: this.height[row * this.columns + column], slopeX: 0, slopeY: 0 };
  }

  /** Returns the material of the block or of the nearest node at a position [m]. */
  materialAt(x: number, y: number): number {
    if (this.material.length === 0) return 0;
    const shift = this.smooth ? 0.5 : 0;
    const column = Math.floor((x - this.x0) / this.cell + shift);
    const row = Math.floor((y - this.y0) / this.cell + shift);
    return this.material[
      clamp(row, 0, this.rows - 1) * this.columns + clamp(column, 0, this.columns - 1)
    ];
  }

  /** Returns height and slopes between four samples of a smooth surface. */
  private bilinear(across: number, up: number): Place {
    const [a, b] = [clamp(across, 0, this.columns - 1), clamp(up, 0, this.rows - 1)];
    const column = Math.min(Math.floor(a), this.columns - 2);
    const row = Math.min(Math.floor(b), this.rows - 2);
    const [u, v, first] = [a - column, b - row, row * this.columns + column];
    const [p, q] = [this.height[first], this.height[first + 1]];
    const [r, s] = [this.height[first + this.columns], this.height[first + this.columns + 1]];
    return {
      height: (1 - v) * (p + u * (q - p)) + v * (r + u * (s - r)),
      slopeX: ((1 - v) * (q - p) + v * (s - r)) / this.cell,
      slopeY: ((1 - u) * (r - p) + u * (s - q)) / this.cell,
    };
  }
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}

/** Unpacks what cosim/report/geometry.py has packed. */
export async function unpackSurface(packed: PackedSurface): Promise<Surface> {
  const grid = await unpack(packed);
  const material = grid.has("material") ? grid.column("material").map(Math.round) : [];
  return new Surface(packed, grid.column("height"), Uint8Array.from(material));
}

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
