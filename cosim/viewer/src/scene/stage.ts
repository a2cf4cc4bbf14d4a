import { Vector3, type WebGLRenderer } from "three";
import type { Colours } from "../theme";
import type { Actor } from "./actor";
import { Eye, makeRenderer } from "./camera";

const EYE = new Vector3(0.68, -0.92, 0.52); // m    of the camera, from the robot: front right
const LOOK = new Vector3(0, 0, 0.05); // m    target of the camera, above the ground
const STACKED = 560; // px    width below which views are placed above each other

/** The 3D views of all runs, side by side, with one camera; each view looks at its own robot. */
export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly eye: Eye;
  private stale = true;
  private compiled = false;

  /** Throws when the browser has no WebGL. */
  constructor(
    private readonly host: HTMLElement,
    readonly actors: readonly Actor[],
  ) {
    this.renderer = makeRenderer(host);
    this.eye = this.makeEye();
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  paint(colours: Colours): void {
    for (const actor of this.actors) actor.paint(colours);
    this.stale = true;
  }

  show(time: number): void {
    for (const actor of this.actors) actor.show(time);
    this.stale = true;
  }

  /**
   * Lets the graphics driver compile the shaders, in the background where it can. Nothing is drawn
   * before.
   */
  async prepare(): Promise<void> {
    await Promise.all(
      this.actors.map((actor) => this.renderer.compileAsync(actor.scene, this.eye.view)),
    );
    this.compiled = true;
    this.stale = true;
  }

  /** Resets the camera. */
  home(): void {
    this.eye.home();
    this.stale = true;
  }

  /** Draws the views if anything has changed. */
  render(): void {
    if (!this.stale || !this.compiled) return;
    this.stale = false;
    const { width, height, columns, rows } = this.layout();
    const [w, h] = [width / columns, height / rows];
    this.renderer.setScissorTest(true);
    this.actors.forEach((actor, k) => {
      const [left, bottom] = [(k % columns) * w, height - (Math.floor(k / columns) + 1) * h];
      this.renderer.setViewport(left, bottom, w, h);
      this.renderer.setScissor(left, bottom, w, h);
      this.eye.lookFrom(actor.place, w / h);
      this.renderer.render(actor.scene, this.eye.view);
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

  /** Makes the camera: dragging turns the view; wheel and vertical swipes scroll the page. */
  private makeEye(): Eye {
    const canvas = this.renderer.domElement;
    canvas.addEventListener(
      "wheel",
      (event) => !(event.ctrlKey || event.metaKey) && event.stopImmediatePropagation(),
      { capture: true },
    );
    const eye = new Eye(canvas, EYE, LOOK);
    canvas.style.touchAction = "pan-y";
    eye.controls.addEventListener("change", () => {
      this.stale = true;
    });
    return eye;
  }
}
