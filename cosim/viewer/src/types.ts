/**
 * The content of the page's payload (cosim/report/payload.py). SI units unless a column says
 * otherwise; legs in the order LF LM LR RF RM RR.
 */

export type Vector = readonly [number, number, number];

export interface Link {
  readonly axis: Vector;
  readonly tip: Vector;
}

export interface Leg {
  readonly name: string;
  readonly hip: Vector;
  readonly yaw: number;
  readonly links: readonly Link[];
}

export interface Robot {
  readonly torso: { readonly com: Vector; readonly size: Vector };
  readonly foot: number;
  readonly legs: readonly Leg[];
  readonly joints: readonly string[];
  readonly colours: Readonly<Record<string, string>>;
  readonly thickness: readonly number[];
}

/** A plane; with `surface`, the number of the surface whose heights are above the plane's. */
export interface Ground {
  readonly height: number;
  readonly rise: number;
  readonly heading: number;
  readonly surface?: number;
}

export interface Material {
  readonly look: string;
  readonly text: string;
}

/** Columns packed by cosim/report/columns.py: name, size of a step and value of step 0. */
export interface Packed {
  readonly rows: number;
  readonly start: number;
  readonly tick: number;
  readonly columns: readonly (readonly [string, number, number])[];
  readonly data: string;
}

/** A grid of heights and materials, row by row; `across`: the number of columns of the grid. */
export interface PackedSurface extends Packed {
  readonly kind: "smooth" | "blocks";
  readonly across: number;
  readonly x0: number;
  readonly y0: number;
  readonly cell: number;
  readonly materials: readonly Material[];
}

export interface PackedRun extends Packed {
  readonly label: string;
  /** The name of the run in the style sheet. */
  readonly key: string;
  /** Lengths of strokes and gaps of its curves [px]; none for a whole line. */
  readonly dash: readonly number[];
  readonly period: number;
  readonly robot: Robot;
  readonly ground: Ground;
}

export interface Payload {
  readonly contact: number;
  readonly surfaces: readonly PackedSurface[];
  readonly runs: readonly PackedRun[];
}
