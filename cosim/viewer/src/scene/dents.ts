import {
  CircleGeometry,
  Color,
  InstancedMesh,
  Matrix4,
  MeshLambertMaterial,
  Quaternion,
  Vector3,
} from "three";
import type { PackedFootprint } from "../types";
import type { Relief } from "./surface";

const LEAST = 0.001; // m    of depth; a smaller dent is not drawn
const LIFT = 0.0012; // m    of a dent above the ground, which would hide it
const DEEP = 0.03; // m    of depth, from which on a dent has its darkest shade
const [LIGHT, DARK] = [0.8, 0.4]; // shades of the ground's colour, from flat to deep
const ROUNDING = 1e-6; // s    of packed times

/** Footprints in soil, each from its touch-down on: discs on the ground, a deeper one darker. */
export class Dents extends InstancedMesh<CircleGeometry, MeshLambertMaterial> {
  private readonly dents: { begin: number; end: number; place: Matrix4; shade: Color }[];

  constructor(footprints: readonly PackedFootprint[], relief: Relief) {
    const deep = footprints.filter(([, , , , depth]) => depth > LEAST);
    super(new CircleGeometry(1, 28), new MeshLambertMaterial(), Math.max(deep.length, 1));
    this.dents = deep.map(([begin, end, x, y, depth, radius]) => ({
      begin: begin - ROUNDING,
      end: end > 0 ? end - ROUNDING : Number.POSITIVE_INFINITY,
      place: placed(x, y, radius, relief),
      shade: new Color().setScalar(LIGHT - (LIGHT - DARK) * Math.min(depth / DEEP, 1)),
    }));
    this.setColorAt(0, new Color()); // makes the buffer of colours
    this.frustumCulled = false;
    this.receiveShadow = true;
    this.count = 0;
  }

  /** Shows the dents that are there at a time [s]. */
  show(time: number): void {
    const now = this.dents.filter(({ begin, end }) => begin <= time && time < end);
    now.forEach(({ place, shade }, k) => {
      this.setMatrixAt(k, place);
      this.setColorAt(k, shade);
    });
    this.count = now.length;
    this.instanceMatrix.needsUpdate = true;
    this.instanceColor!.needsUpdate = true;
  }

  paint(ground: Color): void {
    this.material.color.copy(ground);
  }
}

/** Returns place, direction and size of a dent. */
function placed(x: number, y: number, radius: number, relief: Relief): Matrix4 {
  const normal = relief.normal(x, y);
  return new Matrix4().compose(
    new Vector3(x, y, relief.height(x, y)).addScaledVector(normal, LIFT),
    new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), normal),
    new Vector3().setScalar(radius),
  );
}
