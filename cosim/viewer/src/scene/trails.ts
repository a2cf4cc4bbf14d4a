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
const ENLARGED = [1, 2, 5, 10, 20, 50]; // factors by which trails may be drawn longer
const WISHED = 0.05; // m    largest length of a long trail as drawn
const WIDTH = 0.009; // m    of a trail
const LEAST = 0.0004; // m    of slip; a foot that slipped less leaves no trail
const LIFT = 0.0015; // m    height of trails above the ground, which would hide them
const SCALE = 0.006; // m    of slip for the colour HOT
const COOL = new Color("#f7c948");
const HOT = new Color("#c2185b");

/** A foot on the ground: its place at touch-down, and row by row its slip [m] since then. */
export interface StancePhase {
  readonly place: Vector3;
  readonly rows: readonly number[];
  readonly slipped: readonly (readonly [number, number])[];
}

/** Returns all stances of all feet; [] when the recording lacks the columns. */
export function findStancePhases(
  recording: Recording,
  robot: Robot,
  relief: Relief,
): StancePhase[] {
  return robot.legs.flatMap(({ name }, index) => {
    const names = [`${name}.contact`, `${name}.slipped.x`, `${name}.slipped.y`];
    if (!recording.has(...names)) return [];
    const [contact, x, y] = names.map((each) => recording.column(each));
    return periods(contact).map(([begin, end]): StancePhase => {
      const foot = footCentres(robot, poseAt(recording, robot, recording.time[begin]))[index];
      const last = Math.min(end - begin, MOST_POINTS - 1);
      const rows = Array.from({ length: last + 1 }, (_, k) =>
        Math.round(begin + ((end - begin) * k) / Math.max(last, 1)),
      );
      const slipped = rows.map((row) => [x[row] - x[begin], y[row] - y[begin]] as const);
      return { place: relief.mark(foot, robot.foot), rows, slipped };
    });
  });
}

/** Returns the first and last row of every period in which a flag is on. */
function periods(flag: Float32Array): [number, number][] {
  const found: [number, number][] = [];
  flag.forEach((value, row) => {
    if (value < 0.5) return;
    if (row > 0 && flag[row - 1] > 0.5) found[found.length - 1][1] = row;
    else found.push([row, row]);
  });
  return found;
}

/** Returns how far a stance's foot slipped in total [m]. */
function slippedBy({ slipped }: StancePhase): number {
  return Math.hypot(...slipped[slipped.length - 1]);
}

/** Returns the factor by which all trails are drawn longer, so that the longest are visible. */
export function enlargement(stances: readonly StancePhase[]): number {
  const ways = stances.map(slippedBy).sort((a, b) => a - b);
  const long = ways[Math.floor(0.95 * (ways.length - 1))] ?? 0;
  return ENLARGED.filter((times) => times * long <= WISHED).pop() ?? 1;
}

/** Discs at touch-downs, and trails of slip under load, yellow to red by distance. */
export class Trails extends Group {
  private readonly discs: InstancedMesh<CircleGeometry, MeshBasicMaterial>;
  private readonly ribbon: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly discRows: number[];
  private readonly pieceRows: number[];

  constructor(
    stances: readonly StancePhase[],
    private readonly recording: Recording,
    relief: Relief,
    enlarged: number,
    radius: number,
  ) {
    super();
    const ordered = [...stances].sort((a, b) => a.rows[0] - b.rows[0]);
    this.discRows = ordered.map((stance) => stance.rows[0]);
    this.discs = makeDiscs(ordered, relief, radius);
    const pieces = ordered
      .filter((stance) => slippedBy(stance) > LEAST)
      .flatMap((stance) => piecesOf(stance, relief, enlarged))
      .sort((a, b) => a.row - b.row);
    this.pieceRows = pieces.map(({ row }) => row);
    this.ribbon = makeRibbon(pieces);
    this.add(this.discs, this.ribbon);
  }

  /** Shows what has happened up to a time. */
  show(time: number): void {
    const { row } = this.recording.place(time);
    this.discs.count = countUpTo(this.discRows, row);
    this.ribbon.geometry.setDrawRange(0, 6 * countUpTo(this.pieceRows, row));
  }

  /** Returns the numbers of discs and of pieces of trails that are drawn. */
  shown(): { discs: number; pieces: number } {
    return { discs: this.discs.count, pieces: this.ribbon.geometry.drawRange.count / 6 };
  }

  paint(colour: Color): void {
    this.discs.material.color.copy(colour);
  }
}

/** A piece of a trail: two triangles by their corners. */
interface Piece {
  readonly row: number;
  readonly corners: readonly number[];
  readonly colour: Color;
}

function piecesOf(
  { place, rows, slipped }: StancePhase,
  relief: Relief,
  enlarged: number,
): Piece[] {
  const points = slipped.map(([x, y]) => [place.x + enlarged * x, place.y + enlarged * y]);
  // a trail on a block stays on it: a longer one would climb walls that the foot did not
  const flat = relief.surface && !relief.surface.smooth;
  return rows.slice(1).map((row, k) => {
    const [from, to] = [points[k], points[k + 1]];
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    const half = (0.5 * WIDTH) / (Math.hypot(dx, dy) || 1);
    const corner = ([x, y]: number[], side: number) => {
      const [u, v] = [x - side * half * dy, y + side * half * dx];
      return [u, v, (flat ? place.z : relief.height(u, v)) + LIFT];
    };
    const [a, b, c, d] = [corner(from, 1), corner(from, -1), corner(to, 1), corner(to, -1)];
    const way = Math.hypot(...slipped[k + 1]);
    const colour = COOL.clone().lerp(HOT, Math.min(way / SCALE, 1));
    return { row, corners: [a, b, c, c, b, d].flat(), colour };
  });
}

function makeRibbon(pieces: readonly Piece[]): Mesh<BufferGeometry, MeshBasicMaterial> {
  const colours = pieces.flatMap(({ colour }) => Array(6).fill(colour.toArray()).flat());
  const attribute = (values: number[]) => new BufferAttribute(new Float32Array(values), 3);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", attribute(pieces.flatMap(({ corners }) => [...corners])));
  geometry.setAttribute("color", attribute(colours));
  const material = new MeshBasicMaterial({ vertexColors: true, side: DoubleSide });
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  return mesh;
}

function makeDiscs(stances: readonly StancePhase[], relief: Relief, radius: number) {
  const material = new MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false });
  const mesh = new InstancedMesh(
    new CircleGeometry(0.8 * radius, 24),
    material,
    Math.max(stances.length, 1),
  );
  const [up, size] = [new Vector3(0, 0, 1), new Vector3(1, 1, 1)];
  stances.forEach(({ place }, k) => {
    const normal = relief.normal(place.x, place.y);
    const at = place.clone().addScaledVector(normal, 0.5 * LIFT);
    const turn = new Quaternion().setFromUnitVectors(up, normal);
    mesh.setMatrixAt(k, new Matrix4().compose(at, turn, size));
  });
  mesh.frustumCulled = false;
  return mesh;
}

/** Returns how many of the rows, in rising order, are at most a row. */
function countUpTo(rows: readonly number[], row: number): number {
  const first = rows.findIndex((each) => each > row);
  return first < 0 ? rows.length : first;
}
