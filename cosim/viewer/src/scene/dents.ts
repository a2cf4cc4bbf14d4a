import {
  BufferAttribute,
  BufferGeometry,
  Color,
  InstancedMesh,
  Matrix4,
  MeshLambertMaterial,
  Quaternion,
  Vector3,
} from "three";
import type { Recording } from "../recording";
import type { PackedFootprint } from "../types";
import type { Relief } from "./relief";

const LEAST = 0.001; // m    of depth; a smaller dent is not drawn
const LIFT = 0.0012; // m    of a dent's middle above the ground, which would hide it
const RIM = 0.16; // height of the rim over the dent's radius
const RINGS = [0, 0.25, 0.5, 0.7, 0.82, 0.92, 1, 1.15, 1.35]; // radii over that of the dent
const SECTORS = 28;
const DEEP = 0.03; // m    of depth, from which on a dent has its darkest shade
const DARK = 0.45; // by which the darkest shade is below the lightest
const STEEP = 1.6; // slope of the shaded bowl at its edge

/** A dent: when it is made and when it ends [s], where, how deep and how wide [m]. */
export interface Dent {
  readonly begin: number;
  readonly end: number;
  readonly x: number;
  readonly y: number;
  readonly depth: number;
  readonly radius: number;
}

/** Returns the dents of footprints, in order of time. */
export function findDents(footprints: readonly PackedFootprint[]): Dent[] {
  return footprints
    .filter(([, , , , depth]) => depth > LEAST)
    .map(([begin, end, x, y, depth, radius]) => ({
      begin,
      end: end > 0 ? end : Number.POSITIVE_INFINITY,
      x,
      y,
      depth,
      radius,
    }))
    .sort((a, b) => a.begin - b.begin);
}

/**
 * Dents of footprints, each from its touch-down on. A dent is a disc on the ground that is shaded as
 * a bowl with a rim, a deeper one darker: a true bowl would lie under the drawn surface.
 */
export class Dents extends InstancedMesh<BufferGeometry, MeshLambertMaterial> {
  private readonly places: readonly Matrix4[];
  private readonly shades: readonly Color[];

  constructor(
    private readonly dents: readonly Dent[],
    relief: Relief,
    private readonly recording: Recording,
  ) {
    super(bowl(), new MeshLambertMaterial(), Math.max(dents.length, 1));
    this.places = dents.map((dent) => placed(dent, relief));
    this.shades = dents.map(({ depth }) => shaded(depth));
    this.shades.forEach((shade, k) => {
      this.setColorAt(k, shade); // makes the buffer of colours
    });
    this.frustumCulled = false;
    this.receiveShadow = true;
    this.count = 0;
  }

  /** Shows the dents that are there at a time [s]. */
  show(time: number): void {
    const now = this.recording.time[this.recording.place(time).row] + 1e-6;
    let count = 0;
    this.dents.forEach(({ begin, end }, k) => {
      if (begin > now || end <= now) return;
      this.setMatrixAt(count, this.places[k]);
      this.setColorAt(count, this.shades[k]);
      count++;
    });
    this.count = count;
    this.instanceMatrix.needsUpdate = true;
    if (this.instanceColor) this.instanceColor.needsUpdate = true;
  }

  paint(ground: Color): void {
    this.material.color.copy(ground);
    this.material.vertexColors = true;
    this.material.needsUpdate = true;
  }
}

/** Returns place, direction and size of a dent. */
function placed(dent: Dent, relief: Relief): Matrix4 {
  const normal = relief.normal(dent.x, dent.y);
  const place = new Vector3(dent.x, dent.y, relief.height(dent.x, dent.y));
  return new Matrix4().compose(
    place.addScaledVector(normal, LIFT),
    new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), normal),
    new Vector3(dent.radius, dent.radius, dent.radius),
  );
}

/** Returns the grey of a dent by its depth [m]. */
function shaded(depth: number): Color {
  const shade = 1 - DARK * Math.min(depth / DEEP, 1);
  return new Color(shade, shade, shade);
}

/** Returns a disc of radius 1 with the normals of a bowl and a rim that rises around it. */
function bowl(): BufferGeometry {
  const positions: number[] = [];
  const normals: number[] = [];
  const colours: number[] = [];
  for (const radius of RINGS) {
    const inside = radius < 1;
    const [first, last] = [1, RINGS[RINGS.length - 1]];
    const share = inside ? 0 : (radius - first) / (last - first);
    const slope = inside ? -STEEP * radius : radius === 1 ? 0 : 0.8 * (1 - share);
    const height = inside ? RIM * Math.max(radius - 0.7, 0) * 3.3 : RIM * (1 - share) ** 2;
    const shade = inside ? 0.62 + 0.25 * radius * radius : 0.92 + 0.08 * share;
    for (let k = 0; k <= SECTORS; k++) {
      const angle = (2 * Math.PI * k) / SECTORS;
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      const size = Math.hypot(slope, 1);
      positions.push(radius * cos, radius * sin, height);
      normals.push((slope * cos) / size, (slope * sin) / size, 1 / size);
      colours.push(shade, shade, shade);
    }
  }
  const made = new BufferGeometry();
  made.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  made.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
  made.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  made.setIndex(ringIndex());
  return made;
}

function ringIndex(): number[] {
  const index: number[] = [];
  for (let ring = 0; ring + 1 < RINGS.length; ring++) {
    for (let k = 0; k < SECTORS; k++) {
      const at = ring * (SECTORS + 1) + k;
      const next = at + SECTORS + 1;
      index.push(at, next, next + 1, at, next + 1, at + 1);
    }
  }
  return index;
}
