import {
  type Color,
  ConeGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  MeshBasicMaterial,
  Vector3,
} from "three";

const UP = new Vector3(0, 1, 0);
const LENGTH = 0.42; // m    of an arrow for one body weight
const LEAST = 0.01; // body weights    smaller forces are not drawn
const SHAFT = 0.0042; // m    radius
const HEAD = 0.0125; // m    radius

/** Arrows that show the ground's force on each foot, starting where it acts. */
export class ForceArrows extends Group {
  private readonly arrows: { shaft: Mesh; head: Mesh }[];
  // without depth test, so that arrows are visible through the legs
  private readonly material = new MeshBasicMaterial({
    depthTest: false,
    transparent: true,
    opacity: 0.92,
  });

  constructor(count: number) {
    super();
    this.arrows = Array.from({ length: count }, () => {
      const shaft = new Mesh(new CylinderGeometry(SHAFT, SHAFT, 1, 12), this.material);
      const head = new Mesh(new ConeGeometry(HEAD, 2.6 * HEAD, 18), this.material);
      shaft.renderOrder = head.renderOrder = 1;
      this.add(shaft, head);
      return { shaft, head };
    });
  }

  paint(colour: Color): void {
    this.material.color.copy(colour);
  }

  /** Returns the force that each arrow shows [body weights]; [] where no arrow is shown. */
  shown(): number[][] {
    return this.arrows.map(({ shaft }) => {
      if (!shaft.visible) return [];
      return UP.clone()
        .applyQuaternion(shaft.quaternion)
        .multiplyScalar(shaft.scale.y / LENGTH)
        .toArray();
    });
  }

  /** Shows forces [body weights] at points on the ground. */
  show(points: readonly Vector3[], forces: readonly Vector3[]): void {
    this.arrows.forEach(({ shaft, head }, k) => {
      const size = forces[k].length();
      shaft.visible = head.visible = size > LEAST;
      if (size <= LEAST) return;
      const direction = forces[k].clone().divideScalar(size);
      const length = LENGTH * size;
      shaft.scale.set(1, length, 1);
      shaft.position.copy(points[k]).addScaledVector(direction, 0.5 * length);
      head.position.copy(points[k]).addScaledVector(direction, length + HEAD);
      shaft.quaternion.setFromUnitVectors(UP, direction);
      head.quaternion.copy(shaft.quaternion);
    });
  }
}
