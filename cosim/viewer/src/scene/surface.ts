import { inflate } from "../recording";
import type { Material, PackedSurface } from "../types";

// powers of t (1, t, t², t³) in columns; weights of the nodes -1, 0, 1, 2 in rows
const CATMULL_ROM = [
  [0, -0.5, 1, -0.5],
  [1, 0, -2.5, 1.5],
  [0, 0.5, 2, -1.5],
  [0, 0, -0.5, 0.5],
];

/** Length over which the slope of a smooth surface runs out beyond its border [m]. */
export const RUN_OUT = 0.06;

/** Height [m] of a smooth surface and its slopes along x and y. */
export interface Place {
  readonly height: number;
  readonly slopeX: number;
  readonly slopeY: number;
}

/**
 * A grid of heights, as models/ground/surface.py defines it: bicubic between nodes, or blocks with
 * flat tops. Beyond the grid the height of its border goes on, of a smooth surface behind a run-out
 * of its slope.
 */
export class Surface {
  constructor(
    readonly smooth: boolean,
    readonly name: string,
    readonly rows: number,
    readonly columns: number,
    readonly x0: number,
    readonly y0: number,
    readonly cell: number,
    readonly height: Float32Array,
    /** Material of each node or block; empty: all are 0. */
    readonly material: Uint8Array,
    readonly materials: readonly Material[],
  ) {}

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
    if (this.smooth) return this.bicubic(across, up);
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

  private bicubic(across: number, up: number): Place {
    const length = RUN_OUT / this.cell;
    const [column, a, da] = weights(across, this.columns, length);
    const [row, b, db] = weights(up, this.rows, length);
    let [height, slopeX, slopeY] = [0, 0, 0];
    for (let r = 0; r < 4; r++) {
      let [value, slope] = [0, 0];
      for (let c = 0; c < 4; c++) {
        const node = this.node(row - 1 + r, column - 1 + c);
        value += a[c] * node;
        slope += da[c] * node;
      }
      height += b[r] * value;
      slopeX += b[r] * slope;
      slopeY += db[r] * value;
    }
    return { height, slopeX: slopeX / this.cell, slopeY: slopeY / this.cell };
  }

  /** Returns the height of a node; one beyond the border is extrapolated linearly. */
  private node(row: number, column: number): number {
    if (row < 0) return 2 * this.node(0, column) - this.node(1, column);
    if (row >= this.rows)
      return 2 * this.node(this.rows - 1, column) - this.node(this.rows - 2, column);
    const line = row * this.columns;
    if (column < 0) return 2 * this.height[line] - this.height[line + 1];
    if (column < this.columns) return this.height[line + column];
    return 2 * this.height[line + this.columns - 1] - this.height[line + this.columns - 2];
  }
}

/**
 * Returns the cell of a grid coordinate, and the weights of four nodes for height and slope. Beyond
 * the border, at a share u of the length of the run-out [cells], the slope of the border counts
 * (1 - u)² times, and the height contains its integral.
 */
function weights(coordinate: number, count: number, length: number): [number, number[], number[]] {
  const inside = clamp(coordinate, 0, count - 1);
  const cell = Math.min(Math.floor(inside), count - 2);
  const t = inside - cell;
  const beyond = coordinate - inside;
  const left = Math.max(1 - Math.abs(beyond) / length, 0);
  const rise = (Math.sign(beyond) * length * (1 - left ** 3)) / 3;
  const slope = CATMULL_ROM.map(([, q, r, s]) => q + t * (2 * r + t * 3 * s));
  const value = CATMULL_ROM.map(
    ([p, q, r, s], node) => p + t * (q + t * (r + t * s)) + rise * slope[node],
  );
  return [cell, value, slope.map((weight) => left * left * weight)];
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}

/** Unpacks what cosim/report/surface.py has packed. */
export async function unpackSurface(packed: PackedSurface): Promise<Surface> {
  const { rows, columns } = packed;
  const size = rows * columns;
  const planes = await inflate(packed.data);
  const steps = new Uint16Array(size);
  for (let k = 0; k < size; k++) steps[k] = planes[k] + 256 * planes[size + k];
  for (let k = 0; k < size; k++) if (k % columns > 0) steps[k] += steps[k - 1];
  for (let k = columns; k < size; k++) steps[k] += steps[k - columns];
  const height = Float32Array.from(steps, (step) => packed.low + packed.step * step);
  const material = packed.material ? await inflate(packed.material) : new Uint8Array();
  return new Surface(
    packed.kind === "smooth",
    packed.name,
    rows,
    columns,
    packed.x0,
    packed.y0,
    packed.cell,
    height,
    material,
    packed.materials,
  );
}
