import { BufferAttribute, BufferGeometry } from "three";
import { RUN_OUT, type Surface } from "./surface";

export const BEYOND = 12; // m    by which the border's height goes on; fog hides the end
const FINE = 0.0125; // m    spacing of drawn vertices, if the surface is not too large for it
const MOST_VERTICES = 250_000;
const RUN_OUT_PARTS = 6; // drawn cells of the run-out beyond the border

/** Returns the shares of the three colours of materials in that of a material. */
export type Looks = (material: number) => readonly [number, number, number];

/** Returns the mesh of a smooth surface, with several vertices between nodes and exact normals. */
export function smoothGeometry(surface: Surface, looks: Looks): BufferGeometry {
  const step = surface.cell / subdivision(surface);
  const [x, y] = [
    coordinates(surface.x0, surface.cell, surface.columns, step),
    coordinates(surface.y0, surface.cell, surface.rows, step),
  ];
  const count = x.length * y.length;
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  const colours = new Float32Array(3 * count);
  let k = 0;
  for (const v of y) {
    for (const u of x) {
      const { height, slopeX, slopeY } = surface.at(u, v);
      const size = Math.hypot(slopeX, slopeY, 1);
      positions.set([u, v, height], k);
      normals.set([-slopeX / size, -slopeY / size, 1 / size], k);
      colours.set(looks(surface.materialAt(u, v)), k);
      k += 3;
    }
  }
  const made = new BufferGeometry();
  made.setAttribute("position", new BufferAttribute(positions, 3));
  made.setAttribute("normal", new BufferAttribute(normals, 3));
  made.setAttribute("look", new BufferAttribute(colours, 3));
  made.setIndex(new BufferAttribute(triangles(x.length, y.length), 1));
  return made;
}

/** Returns the number of drawn cells for a cell of the surface, along each axis. */
function subdivision(surface: Surface): number {
  const wished = Math.max(Math.round(surface.cell / FINE), 1);
  const most = Math.floor(Math.sqrt(MOST_VERTICES / (surface.rows * surface.columns)));
  return Math.max(Math.min(wished, most), 1);
}

/** Returns the coordinates of vertices along an axis: far beyond the map, in the run-out, on it. */
function coordinates(origin: number, cell: number, count: number, step: number): number[] {
  const cells = Math.round(((count - 1) * cell) / step);
  const inside = Array.from({ length: cells + 1 }, (_, k) => origin + k * step);
  const beyond = Array.from(
    { length: RUN_OUT_PARTS },
    (_, k) => (RUN_OUT * (k + 1)) / RUN_OUT_PARTS,
  );
  const [first, last] = [inside[0], inside[cells]];
  return [
    first - BEYOND,
    ...beyond.map((way) => first - way).reverse(),
    ...inside,
    ...beyond.map((way) => last + way),
    last + BEYOND,
  ];
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
