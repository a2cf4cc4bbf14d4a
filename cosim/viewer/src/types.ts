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

export interface Ground {
  readonly height: number;
  readonly rise: number;
  readonly heading: number;
}

export interface PackedRun {
  readonly label: string;
  readonly period: number;
  readonly bucket: number;
  readonly robot: Robot;
  readonly ground: Ground;
  readonly rows: number;
  readonly start: number;
  readonly tick: number;
  readonly columns: readonly (readonly [string, number, number])[];
  readonly data: string;
}

export interface Payload {
  readonly contact: number;
  readonly runs: readonly PackedRun[];
}
