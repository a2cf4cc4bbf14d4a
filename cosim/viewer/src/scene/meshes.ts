import { BufferAttribute, BufferGeometry } from "three";
import type { Surface } from "./surface";

export const BEYOND = 12; // m    by which the border's height goes on; fog hides the end

/** Returns the shares of the three colours of materials in that of a material. */
export type Looks = (material: number) => readonly [number, number, number];

/** Returns the mesh of the samples of a smooth surface, and of a border around them. */
export function smoothGeometry(surface: Surface, looks: Looks): BufferGeometry {
  const x = coordinates(surface.x0, surface.cell, surface.columns);
  const y = coordinates(surface.y0, surface.cell, surface.rows);
  const places = y.flatMap((v) => x.map((u) => [u, v] as const));
  const attribute = (values: (u: number, v: number) => readonly number[]) =>
    new BufferAttribute(new Float32Array(places.flatMap(([u, v]) => [...values(u, v)])), 3);
  const made = new BufferGeometry();
  made.setAttribute(
    "position",
    attribute((u, v) => [u, v, surface.at(u, v).height]),
  );
  made.setAttribute(
    "look",
    attribute((u, v) => looks(surface.materialAt(u, v))),
  );
  made.setIndex(new BufferAttribute(triangles(x.length, y.length), 1));
  made.computeVertexNormals();
  return made;
}

/** Returns the coordinates of vertices along an axis: those of samples, and far beyond them. */
function coordinates(origin: number, cell: number, count: number): number[] {
  const inside = Array.from({ length: count }, (_, k) => origin + k * cell);
  return [inside[0] - BEYOND, ...inside, inside[count - 1] + BEYOND];
}

function triangles(columns: number, rows: number): Uint32Array {
  const index = new Uint32Array(6 * (columns - 1) * (rows - 1));
  let k = 0;
  for (let row = 0; row + 1 < rows; row++) {
    for (let column = 0; column + 1 < columns; column++) {
      const at = row * columns + column;
      index.set([at, at + 1, at + columns + 1, at, at + columns + 1, at + columns], k);
      k += 6;
    }
  }
  return index;
}

const LONGEST = 0.5; // m    of a line

type Corner = readonly [number, number];

/** Corners, normals and materials of quadrilaterals, and the edges that are drawn as lines. */
class Quads {
  private readonly positions: number[] = [];
  private readonly normals: number[] = [];
  private readonly looks: number[] = [];
  private readonly lines: number[] = [];

  /** Adds a quadrilateral by a corner and two edges; their cross product is along the normal. */
  add(
    corner: readonly number[],
    first: readonly number[],
    second: readonly number[],
    normal: readonly number[],
    look: readonly number[],
  ): void {
    for (const [a, b] of [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 1],
    ]) {
      for (let k = 0; k < 3; k++) this.positions.push(corner[k] + a * first[k] + b * second[k]);
      this.normals.push(...normal);
      this.looks.push(...look);
    }
  }

  /** Adds a line in pieces: the depth of a long one would lose too many digits. */
  addLine(from: readonly number[], to: readonly number[]): void {
    const pieces = Math.ceil(Math.hypot(to[0] - from[0], to[1] - from[1]) / LONGEST);
    for (let k = 0; k < pieces; k++)
      for (const share of [k / pieces, (k + 1) / pieces])
        this.lines.push(...from.map((part, axis) => part + share * (to[axis] - part)));
  }

  geometry(): BufferGeometry {
    const count = this.positions.length / 12;
    const index = new Uint32Array(6 * count);
    for (let k = 0; k < count; k++)
      index.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3], 6 * k);
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(new Float32Array(this.positions), 3));
    made.setAttribute("normal", new BufferAttribute(new Float32Array(this.normals), 3));
    made.setAttribute("look", new BufferAttribute(new Float32Array(this.looks), 3));
    made.setIndex(new BufferAttribute(index, 1));
    return made;
  }

  edges(): BufferGeometry {
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(new Float32Array(this.lines), 3));
    return made;
  }
}

/**
 * Returns the faces of a surface of blocks, tops and walls, and the edges of walls. Blocks at the
 * border go on beyond it.
 */
export function blockGeometry(
  surface: Surface,
  looks: Looks,
): { faces: BufferGeometry; edges: BufferGeometry } {
  const quads = new Quads();
  const { rows, columns, height, material, x0, y0, cell } = surface;
  /** Adds the wall between two blocks; the second one is to the right of the way from a to b. */
  const addWall = (first: number, second: number, a: Corner, b: Corner) => {
    const [low, high] = [height[first], height[second]].sort((one, other) => one - other);
    if (low === high) return;
    const upper = height[first] === high ? first : second;
    const [from, to] = upper === first ? [a, b] : [b, a]; // a wall faces the lower block
    const along = [to[0] - from[0], to[1] - from[1], 0];
    const length = Math.hypot(along[0], along[1]);
    const normal = [along[1] / length, -along[0] / length, 0];
    quads.add([...from, low], along, [0, 0, high - low], normal, looks(material[upper] ?? 0));
    for (const z of [low, high]) quads.addLine([...from, z], [...to, z]);
  };
  for (let k = 0; k < rows * columns; k++) {
    const [row, column] = [Math.floor(k / columns), k % columns];
    const [left, right] = [0, 1].map((next) => border(x0, cell, column + next, columns));
    const [low, high] = [0, 1].map((next) => border(y0, cell, row + next, rows));
    const sides = [
      [right - left, 0, 0],
      [0, high - low, 0],
      [0, 0, 1],
    ] as const; // and the normal
    quads.add([left, low, height[k]], ...sides, looks(material[k] ?? 0));
    if (column + 1 < columns) addWall(k, k + 1, [right, low], [right, high]);
    if (row + 1 < rows) addWall(k, k + columns, [right, high], [left, high]);
  }
  return { faces: quads.geometry(), edges: quads.edges() };
}

/** Returns the coordinate of a border between cells; those of the map are far beyond it. */
function border(origin: number, cell: number, index: number, count: number): number {
  const beyond = index === 0 ? -BEYOND : index === count ? BEYOND : 0;
  return origin + cell * index + beyond;
}
