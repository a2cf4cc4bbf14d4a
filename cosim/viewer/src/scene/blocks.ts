import { BufferAttribute, BufferGeometry } from "three";
import { BEYOND, type Looks } from "./smooth";
import type { Surface } from "./surface";

const LONGEST = 0.5; // m    of a line

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

  addLine(from: readonly number[], to: readonly number[]): void {
    this.lines.push(...from, ...to);
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
 * Returns the faces of a surface of blocks and their edges. Tops of equal height and material are
 * merged to rectangles, walls between equal pairs of heights to strips. Blocks at the border go on
 * beyond it.
 */
export function blockGeometry(
  surface: Surface,
  looks: Looks,
): { faces: BufferGeometry; edges: BufferGeometry } {
  const quads = new Quads();
  addTops(surface, looks, quads);
  addWalls(surface, looks, quads, true);
  addWalls(surface, looks, quads, false);
  return { faces: quads.geometry(), edges: quads.edges() };
}

/** Returns the coordinate of a border between cells; those of the map are far beyond it. */
function border(origin: number, cell: number, index: number, count: number): number {
  const beyond = index === 0 ? -BEYOND : index === count ? BEYOND : 0;
  return origin + cell * index + beyond;
}

function addTops(surface: Surface, looks: Looks, quads: Quads): void {
  const { rows, columns, height, material, x0, y0, cell } = surface;
  const done = new Uint8Array(rows * columns);
  const alike = (k: number, other: number) =>
    !done[k] && height[k] === height[other] && material[k] === material[other];
  for (let first = 0; first < rows * columns; first++) {
    if (done[first]) continue;
    const [row, column] = [Math.floor(first / columns), first % columns];
    let right = column + 1;
    while (right < columns && alike(row * columns + right, first)) right++;
    let top = row + 1;
    while (top < rows && allAlike(top * columns + column, right - column, first, alike)) top++;
    for (let r = row; r < top; r++) done.fill(1, r * columns + column, r * columns + right);
    const [x, y] = [border(x0, cell, column, columns), border(y0, cell, row, rows)];
    quads.add(
      [x, y, height[first]],
      [border(x0, cell, right, columns) - x, 0, 0],
      [0, border(y0, cell, top, rows) - y, 0],
      [0, 0, 1],
      looks(material[first] ?? 0),
    );
  }
}

function allAlike(
  begin: number,
  count: number,
  other: number,
  alike: (k: number, other: number) => boolean,
): boolean {
  for (let k = begin; k < begin + count; k++) if (!alike(k, other)) return false;
  return true;
}

/** Adds the walls that face along x, or those that face along y. */
function addWalls(surface: Surface, looks: Looks, quads: Quads, alongX: boolean): void {
  const { rows, columns, height, material } = surface;
  const [layers, length] = alongX ? [columns, rows] : [rows, columns];
  const place = (layer: number, k: number) => (alongX ? k * columns + layer : layer * columns + k);
  for (let layer = 1; layer < layers; layer++) {
    let begin = 0;
    for (let k = 1; k <= length; k++) {
      const [before, behind] = [place(layer - 1, begin), place(layer, begin)];
      const goesOn =
        k < length &&
        height[place(layer - 1, k)] === height[before] &&
        height[place(layer, k)] === height[behind] &&
        material[place(layer - 1, k)] === material[before] &&
        material[place(layer, k)] === material[behind];
      if (goesOn) continue;
      if (height[before] !== height[behind]) {
        const falls = height[before] > height[behind];
        const look = looks(material[falls ? before : behind] ?? 0);
        addWall(surface, quads, alongX, layer, begin, k, [height[before], height[behind]], look);
      }
      begin = k;
    }
  }
}

/** Adds a wall and its upper and lower edge. It faces the lower of the heights on both sides. */
function addWall(
  surface: Surface,
  quads: Quads,
  alongX: boolean,
  layer: number,
  begin: number,
  end: number,
  [before, behind]: readonly [number, number],
  look: readonly number[],
): void {
  const { rows, columns, x0, y0, cell } = surface;
  const sign = before > behind ? 1 : -1;
  const [low, high] = [Math.min(before, behind), Math.max(before, behind)];
  const [from, to] = alongX
    ? [border(y0, cell, begin, rows), border(y0, cell, end, rows)]
    : [border(x0, cell, begin, columns), border(x0, cell, end, columns)];
  const at = (along: number, z: number) =>
    alongX
      ? [border(x0, cell, layer, columns), along, z]
      : [along, border(y0, cell, layer, rows), z];
  // begins at the end from which way x up points to the lower side
  const forwards = alongX === sign > 0;
  const length = alongX ? [0, to - from, 0] : [to - from, 0, 0];
  quads.add(
    at(forwards ? from : to, low),
    forwards ? length : length.map((part) => -part),
    [0, 0, high - low],
    alongX ? [sign, 0, 0] : [0, sign, 0],
    look,
  );
  // long lines are divided: their depth would lose too many digits against that of the faces
  const pieces = Math.ceil((to - from) / LONGEST);
  for (const z of [low, high])
    for (let k = 0; k < pieces; k++) {
      const place = (share: number) => at(from + (share * (to - from)) / pieces, z);
      quads.addLine(place(k), place(k + 1));
    }
}
