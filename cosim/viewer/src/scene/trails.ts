import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  DoubleSide,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  Vector3,
} from "three";
import { footCentres, poseAt } from "../kinematics";
import type { Recording } from "../recording";
import type { Robot } from "../types";
import type { Relief } from "./surface";

const MOST_POINTS = 60; // of a trail

/**
 * A foot on the ground from touch-down to lift-off: where, and how far it has slipped since
 * touch-down, row by row.
 */
export interface Stance {
  readonly place: Vector3;
  readonly rows: readonly number[];
  readonly slipped: readonly { readonly x: number; readonly y: number }[];
}

/** Returns all stances of all feet; [] when the recording lacks the columns. */
export function findStances(recording: Recording, robot: Robot, relief: Relief): Stance[] {
  return robot.legs.flatMap((leg, index) => {
    const names = [
      `${leg.name}.contact`,
      `${leg.name}.slipped.x`,
      `${leg.name}.slipped.y`,
    ] as const;
    if (!recording.has(...names, "torso.x", "torso.qw", `${leg.name}.coxa.angle`)) return [];
    const [contact, x, y] = names.map((name) => recording.column(name));
    return spans(contact).map(([begin, end]) => {
      const foot = footCentres(robot, poseAt(recording, robot, recording.time[begin]))[index];
      const place = relief.mark(foot, robot.foot);
      const rows = sampled(begin, end);
      return {
        place,
        rows,
        slipped: rows.map((row) => ({ x: x[row] - x[begin], y: y[row] - y[begin] })),
      };
    });
  });
}

/** Returns the first and last row of every period in which a flag is on. */
function spans(flag: Float32Array): [number, number][] {
  const found: [number, number][] = [];
  let begin = -1;
  for (let k = 0; k <= flag.length; k++) {
    const up = k < flag.length && flag[k] > 0.5;
    if (up && begin < 0) begin = k;
    if (!up && begin >= 0) {
      found.push([begin, k - 1]);
      begin = -1;
    }
  }
  return found;
}

function sampled(begin: number, end: number): number[] {
  const count = Math.min(end - begin + 1, MOST_POINTS);
  return Array.from({ length: count }, (_, k) =>
    Math.round(begin + ((end - begin) * k) / Math.max(count - 1, 1)),
  );
}

/** Returns how far a stance's foot slipped in total [m]. */
export function slippedBy(stance: Stance): number {
  const last = stance.slipped[stance.slipped.length - 1];
  return Math.hypot(last.x, last.y);
}

const ENLARGED = [1, 2, 5, 10, 20, 50]; // factors by which trails may be drawn longer
const WISHED = 0.05; // m    largest length of a long trail as drawn
const WIDTH = 0.009; // m    of a trail
const LEAST = 0.0004; // m    of slip; a foot that slipped less leaves no trail
const LIFT = 0.0015; // m    height of trails above the ground, which would hide them
const SCALE = 0.006; // m    of slip for the colour HOT
const COOL = new Color("#f7c948");
const HOT = new Color("#c2185b");

/** Returns the factor by which all trails are drawn longer, so that the longest are visible. */
export function enlargement(stances: readonly Stance[]): number {
  const ways = stances.map(slippedBy).sort((a, b) => a - b);
  const long = ways[Math.floor(0.95 * (ways.length - 1))] ?? 0;
  return ENLARGED.filter((times) => times * long <= WISHED).pop() ?? 1;
}

/** Numbers of footprints and pieces of trails that are drawn, and the time of the latest [s]. */
export interface Shown {
  readonly prints: number;
  readonly pieces: number;
  readonly latest: number | null;
}

/** Footprints at touch-downs, and trails of slip under load, yellow to red by distance. */
export class Trails extends Group {
  private readonly prints: InstancedMesh;
  private readonly ribbon: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly printRows: number[];
  private readonly pieceRows: number[] = [];

  constructor(
    stances: readonly Stance[],
    private readonly recording: Recording,
    relief: Relief,
    enlarged: number,
    radius: number,
  ) {
    super();
    const ordered = [...stances].sort((a, b) => a.rows[0] - b.rows[0]);
    this.printRows = ordered.map((stance) => stance.rows[0]);
    this.prints = footprints(ordered, relief, radius);
    this.ribbon = this.makeRibbon(ordered, relief, enlarged);
    this.add(this.prints, this.ribbon);
  }

  /** Shows what has happened up to a time. */
  show(time: number): void {
    const { row } = this.recording.place(time);
    this.prints.count = countUpTo(this.printRows, row);
    this.ribbon.geometry.setDrawRange(0, 6 * countUpTo(this.pieceRows, row));
  }

  /** Returns what is drawn, from the state passed to the graphics card. */
  shown(): Shown {
    const [prints, pieces] = [this.prints.count, this.ribbon.geometry.drawRange.count / 6];
    const rows = [...this.printRows.slice(0, prints), ...this.pieceRows.slice(0, pieces)];
    const latest = rows.length > 0 ? this.recording.time[Math.max(...rows)] : null;
    return {
      prints: Math.min(prints, this.printRows.length),
      pieces: Math.min(pieces, this.pieceRows.length),
      latest,
    };
  }

  paint(print: Color): void {
    (this.prints.material as MeshBasicMaterial).color.copy(print);
  }

  private makeRibbon(
    stances: readonly Stance[],
    relief: Relief,
    enlarged: number,
  ): Mesh<BufferGeometry, MeshBasicMaterial> {
    const pieces = stances
      .filter((stance) => slippedBy(stance) > LEAST)
      .flatMap((stance) => piecesOf(stance, enlarged));
    pieces.sort((a, b) => a.row - b.row);
    const positions: number[] = [];
    const colours: number[] = [];
    for (const piece of pieces) {
      this.pieceRows.push(piece.row);
      for (const [x, y] of corners(piece)) {
        // a trail on a block stays on it: a longer one would climb walls that the foot did not
        const flat = relief.surface && !relief.surface.smooth;
        positions.push(x, y, (flat ? piece.level : relief.height(x, y)) + LIFT);
      }
      const colour = COOL.clone().lerp(HOT, Math.min(piece.way / SCALE, 1));
      for (let k = 0; k < 6; k++) colours.push(colour.r, colour.g, colour.b);
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
    const mesh = new Mesh(
      geometry,
      new MeshBasicMaterial({ vertexColors: true, side: DoubleSide }),
    );
    mesh.frustumCulled = false;
    return mesh;
  }
}

interface Piece {
  readonly row: number;
  readonly from: readonly [number, number];
  readonly to: readonly [number, number];
  readonly way: number;
  /** Height of the stance [m]. */
  readonly level: number;
}

function piecesOf(stance: Stance, enlarged: number): Piece[] {
  const points = stance.slipped.map(({ x, y }): [number, number] => [
    stance.place.x + enlarged * x,
    stance.place.y + enlarged * y,
  ]);
  return stance.rows.slice(1).map((row, k) => {
    const { x, y } = stance.slipped[k + 1];
    return {
      row,
      from: points[k],
      to: points[k + 1],
      way: Math.hypot(x, y),
      level: stance.place.z,
    };
  });
}

/** Returns the corners of two triangles that form a piece of a trail. */
function corners({ from, to }: Piece): [number, number][] {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  const [sx, sy] = [(-0.5 * WIDTH * dy) / length, (0.5 * WIDTH * dx) / length];
  const a: [number, number] = [from[0] + sx, from[1] + sy];
  const b: [number, number] = [from[0] - sx, from[1] - sy];
  const c: [number, number] = [to[0] + sx, to[1] + sy];
  const d: [number, number] = [to[0] - sx, to[1] - sy];
  return [a, b, c, c, b, d];
}

function footprints(stances: readonly Stance[], relief: Relief, radius: number): InstancedMesh {
  const material = new MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false });
  const mesh = new InstancedMesh(
    new CircleGeometry(0.8 * radius, 24),
    material,
    Math.max(stances.length, 1),
  );
  stances.forEach((stance, k) => {
    const normal = relief.normal(stance.place.x, stance.place.y);
    const flat = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), normal);
    mesh.setMatrixAt(
      k,
      new Matrix4().compose(
        stance.place.clone().addScaledVector(normal, 0.5 * LIFT),
        flat,
        new Vector3(1, 1, 1),
      ),
    );
  });
  mesh.frustumCulled = false;
  return mesh;
}

function countUpTo(rows: readonly number[], row: number): number {
  let low = 0;
  let high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle] <= row) low = middle + 1;
    else high = middle;
  }
  return low;
}
