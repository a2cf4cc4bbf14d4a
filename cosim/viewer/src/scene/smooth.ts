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
