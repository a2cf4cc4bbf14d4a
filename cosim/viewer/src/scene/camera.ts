import { PCFShadowMap, PerspectiveCamera, type Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD = 36; // deg    vertical field of view
const WIDE = 1.3; // width over height; a narrower view needs more than FIELD to show the robot
const SHARPEST = 2; // largest number of device pixels per pixel

/** Returns a renderer with shadows whose canvas is the host's first child; throws without WebGL. */
export function makeRenderer(host: HTMLElement): WebGLRenderer {
  const renderer = new WebGLRenderer({ antialias: true, powerPreference: "high-performance" });
  renderer.debug.checkShaderErrors = false; // the check would wait for the compiler
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = PCFShadowMap;
  renderer.setPixelRatio(Math.min(devicePixelRatio, SHARPEST));
  renderer.domElement.setAttribute("aria-hidden", "true");
  host.prepend(renderer.domElement);
  return renderer;
}

/** A camera that the reader turns about an anchor, which may move. */
export class Eye {
  /** As it is drawn with, after `lookFrom`. */
  readonly view = new PerspectiveCamera(FIELD, 1, 0.02, 60);
  readonly controls: OrbitControls;
  private readonly camera = new PerspectiveCamera(FIELD, 1, 0.02, 60);

  /** position, target: of the camera at first, from the anchor [m]. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly position: Vector3,
    private readonly target: Vector3,
  ) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, {
      enablePan: false,
      minDistance: 0.25,
      maxDistance: 4,
      maxPolarAngle: 0.49 * Math.PI,
    });
    this.home();
  }

  /** Resets the camera. */
  home(): void {
    this.camera.position.copy(this.position).add(this.target);
    this.controls.target.copy(this.target);
    this.controls.update();
  }

  /** Moves `view` to an anchor; the field is larger for narrow views so that the robot fits. */
  lookFrom(anchor: Vector3, aspect: number): void {
    this.view.position.copy(this.camera.position).add(anchor);
    this.view.quaternion.copy(this.camera.quaternion);
    this.view.aspect = aspect;
    const half = Math.tan((FIELD * Math.PI) / 360) * Math.max(1, WIDE / aspect);
    this.view.fov = (360 * Math.atan(half)) / Math.PI;
    this.view.updateProjectionMatrix();
    this.view.updateMatrixWorld();
  }
}
