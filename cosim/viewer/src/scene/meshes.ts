import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  InstancedBufferAttribute,
  InstancedMesh,
  type Material,
  Matrix4,
  Mesh,
  Quaternion,
  Vector3,
} from "three";
import type { Surface } from "./surface";

const BEYOND = 12; // m    by which the border's height goes on; fog hides the end
const DEEPER = 0.1; // m    of blocks, below the lowest one

/** Returns the shares of the three colours of materials in that of a material. */
export type Looks = (material: number) => readonly [number, number, number];

/** Returns the mesh of the samples of a smooth surface, and of a border around them. */
export function smoothMesh(surface: Surface, looks: Looks, material: Material): Mesh {
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
  return new Mesh(made, material);
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

/** Returns the blocks of a surface as boxes; those at the border go on beyond it. */
export function blockMesh(surface: Surface, looks: Looks, material: Material): InstancedMesh {
  const { rows, columns, height, x0, y0, cell } = surface;
  const box = new BoxGeometry(1, 1, 1).translate(0.5, 0.5, -0.5); // its top is at z = 0
  const mesh = new InstancedMesh(box, material, rows * columns);
  const look = new InstancedBufferAttribute(new Float32Array(3 * rows * columns), 3);
  const [low, high] = surface.range;
  const level = new Quaternion();
  for (let k = 0; k < rows * columns; k++) {
    const [row, column] = [Math.floor(k / columns), k % columns];
    const [left, right] = [0, 1].map((next) => border(x0, cell, column + next, columns));
    const [near, far] = [0, 1].map((next) => border(y0, cell, row + next, rows));
    const size = new Vector3(right - left, far - near, high - low + DEEPER);
    mesh.setMatrixAt(k, new Matrix4().compose(new Vector3(left, near, height[k]), level, size));
    look.set(looks(surface.material[k] ?? 0), 3 * k);
  }
  box.setAttribute("look", look);
  return mesh;
}

/** Returns the coordinate of a border between cells; those of the map are far beyond it. */
function border(origin: number, cell: number, index: number, count: number): number {
  const beyond = index === 0 ? -BEYOND : index === count ? BEYOND : 0;
  return origin + cell * index + beyond;
}
