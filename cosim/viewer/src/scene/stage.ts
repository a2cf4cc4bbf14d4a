import { PCFShadowMap, PerspectiveCamera, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Colours } from "../theme";
import type { Actor } from "./actor";

const EYE = new Vector3(0.68, -0.92, 0.52); // m    of the camera, from the robot: front right
const LOOK = new Vector3(0, 0, 0.05); // m    target of the camera, above the ground
const FIELD = 36; // deg    vertical field of view
const WIDE = 1.25; // width over height; a narrower view needs more than FIELD to show the robot
const STACKED = 560; // px    width below which views are placed above each other
const SHARPEST = 2; // largest number of device pixels per pixel

/** The 3D views of all runs, side by side, with one camera; each view looks at its own robot. */
export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly camera = new PerspectiveCamera(FIELD, 1, 0.02, 60);
  private readonly view = new PerspectiveCamera(FIELD, 1, 0.02, 60);
  private readonly controls: OrbitControls;
  private readonly anchors: Vector3[];
  private following = true;
  private stale = true;
  private warm = false;

  /** Throws when the browser has no WebGL. */
  constructor(
    private readonly host: HTMLElement,
    readonly actors: readonly Actor[],
  ) {
    this.renderer = new WebGLRenderer({ antialias: true, powerPreference: "high-performance" });
    this.renderer.debug.checkShaderErrors = false; // the check would wait for the compiler
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, SHARPEST));
    this.renderer.domElement.setAttribute("aria-hidden", "true");
    host.prepend(this.renderer.domElement);
    this.anchors = actors.map(() => new Vector3());
    this.camera.up.set(0, 0, 1);
    this.view.up.set(0, 0, 1);
    this.controls = this.makeControls();
    this.home();
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  get follows(): boolean {
    return this.following;
  }

  set follows(follow: boolean) {
    this.following = follow;
    this.stale = true;
  }

  paint(colours: Colours): void {
    for (const actor of this.actors) actor.paint(colours);
    this.stale = true;
  }

  show(time: number): void {
    this.actors.forEach((actor, k) => {
      actor.show(time);
      if (this.following) this.anchors[k].copy(actor.place);
    });
    this.stale = true;
  }

  /**
   * Lets the graphics driver compile the shaders, in the background where it can. Nothing is drawn
   * before.
   */
  async prepare(): Promise<void> {
    const aside = this.renderer.extensions.has("KHR_parallel_shader_compile");
    if (aside)
      await Promise.all(
        this.actors.map((actor) => this.renderer.compileAsync(actor.scene, this.view)),
      );
    this.warm = true;
    this.stale = true;
  }

  /** Resets the camera. */
  home(): void {
    this.camera.position.copy(EYE).add(LOOK);
    this.controls.target.copy(LOOK);
    this.controls.update();
    this.stale = true;
  }

  /** Draws the views if anything has changed. */
  render(): void {
    if (!this.stale || !this.warm) return;
    this.stale = false;
    const { width, height, columns, rows } = this.layout();
    const [w, h] = [width / columns, height / rows];
    this.renderer.setScissorTest(true);
    this.actors.forEach((actor, k) => {
      const [left, bottom] = [(k % columns) * w, height - (Math.floor(k / columns) + 1) * h];
      this.renderer.setViewport(left, bottom, w, h);
      this.renderer.setScissor(left, bottom, w, h);
      this.view.position.copy(this.camera.position).add(this.anchors[k]);
      this.view.quaternion.copy(this.camera.quaternion);
      this.view.aspect = w / h;
      this.view.fov = fieldOf(w / h);
      this.view.updateProjectionMatrix();
      this.renderer.render(actor.scene, this.view);
    });
  }

  private layout(): { width: number; height: number; columns: number; rows: number } {
    const { clientWidth: width, clientHeight: height } = this.host;
    const columns = width < STACKED ? 1 : this.actors.length;
    return { width, height, columns, rows: this.actors.length / columns };
  }

  private resize(): void {
    const { width, height, columns } = this.layout();
    this.host.dataset.layout = columns === 1 ? "stacked" : "side-by-side";
    this.renderer.setSize(width, height, false);
    this.stale = true;
  }

  /** Makes the controls: dragging turns the view; wheel and vertical swipes scroll the page. */
  private makeControls(): OrbitControls {
    const canvas = this.renderer.domElement;
    canvas.addEventListener(
      "wheel",
      (event) => !(event.ctrlKey || event.metaKey) && event.stopImmediatePropagation(),
      { capture: true },
    );
    const controls = new OrbitControls(this.camera, canvas);
    canvas.style.touchAction = "pan-y";
    Object.assign(controls, {
      enablePan: false,
      minDistance: 0.25,
      maxDistance: 4,
      maxPolarAngle: 0.49 * Math.PI,
    });
    controls.addEventListener("change", () => {
      this.stale = true;
    });
    return controls;
  }
}

/** Returns the vertical field of view [deg], larger for narrow views so that the robot fits. */
function fieldOf(aspect: number): number {
  const half = Math.tan((FIELD * Math.PI) / 360) * Math.max(1, WIDE / aspect);
  return (360 * Math.atan(half)) / Math.PI;
}
