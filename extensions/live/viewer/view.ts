import { Color, Plane, Quaternion, Raycaster, Vector2, Vector3, type WebGLRenderer } from "three";
import type { Pose } from "../../../cosim/viewer/src/kinematics";
import { ForceArrows } from "../../../cosim/viewer/src/scene/arrows";
import { Eye, makeRenderer } from "../../../cosim/viewer/src/scene/camera";
import { RobotScene } from "../../../cosim/viewer/src/scene/robot_scene";
import { Relief, unpackSurface } from "../../../cosim/viewer/src/scene/surface";
import { property, readColours } from "../../../cosim/viewer/src/theme";
import type { Connection } from "./link";
import { type Frame, footForces, type World } from "./messages";

const EYE = new Vector3(-0.86, -0.68, 0.56); // m    of the camera: behind the robot, to the right
const LOOK = new Vector3(0.06, 0, 0.04); // m    target of the camera, above the ground
const SOFT = 0.15; // share of the way to the robot's height that the camera goes in a picture
const RULER = 0.42; // m    of dragging for a push of one body weight, as long as its arrow

/** The robot on its ground, in one scene, seen by a camera that goes along. */
export class View {
  readonly eye: Eye;
  private readonly renderer: WebGLRenderer;
  private readonly push = new ForceArrows(1);
  private readonly place = new Vector3(); // that the camera looks at
  private readonly torso = new Vector3();
  private world: World | undefined;
  private relief: Relief | undefined;
  private scene: RobotScene | undefined;
  /** Number of pictures that were drawn. */
  drawn = 0;

  /** Throws when the browser has no WebGL. */
  constructor(private readonly host: HTMLElement) {
    this.renderer = makeRenderer(host);
    this.eye = new Eye(this.renderer.domElement, EYE, LOOK);
    const resize = () => this.renderer.setSize(host.clientWidth, host.clientHeight, false);
    new ResizeObserver(resize).observe(host);
    resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  /** Builds robot and ground. */
  async build(world: World): Promise<void> {
    const surfaces = await Promise.all(world.surfaces.map(unpackSurface));
    this.world = world;
    this.relief = new Relief(world.ground, surfaces[world.ground.surface ?? -1]);
    this.scene = new RobotScene(world.robot, this.relief, new Color(property("--accent")));
    this.scene.add(this.push);
    this.place.z = this.relief.height(0, 0);
    this.paint();
  }

  /** Takes the page's present colours. */
  paint(): void {
    this.scene?.paint(readColours());
    this.push.paint(new Color(property("--push")));
  }

  /** Draws the robot with its forces and contacts as of a frame. */
  draw(frame: Frame): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (!this.scene || !this.world || width === 0 || height === 0) return;
    const [w, x, y, z] = frame.quaternion;
    const pose: Pose = {
      position: new Vector3(...frame.position),
      attitude: new Quaternion(x, y, z, w).normalize(),
      angles: Float64Array.from(frame.angle),
    };
    this.follow(pose);
    const forces = footForces(frame).map((force) => new Vector3(...force));
    const contact = forces.map((force) => force.length() > 0);
    this.scene.show(pose, contact, forces, this.place);
    this.push.show([pose.position], [new Vector3(...frame.push).divideScalar(this.world.weight)]);
    this.eye.lookFrom(this.place, width / height);
    this.renderer.render(this.scene, this.eye.view);
    this.drawn += 1;
  }

  /** Returns where a pointer's ray meets the robot; undefined beside it. */
  hit(event: PointerEvent): Vector3 | undefined {
    return this.scene && this.ray(event).intersectObject(this.scene.model, true)[0]?.point;
  }

  /** Returns the leg (0 to 5) under a pointer; undefined beside the legs. */
  legAt(event: PointerEvent): number | undefined {
    return (
      this.scene && this.ray(event).intersectObject(this.scene.model, true)[0]?.object.userData.leg
    );
  }

  /**
   * Returns the push [body weights] of a drag from a point of the robot to the pointer: along the
   * ground, or upwards with `lift`.
   */
  pull(event: PointerEvent, from: Vector3, lift: boolean): Vector3 {
    const normal = lift
      ? this.eye.view.getWorldDirection(new Vector3()).setZ(0).normalize()
      : new Vector3(0, 0, 1);
    const plane = new Plane().setFromNormalAndCoplanarPoint(normal, from);
    const to = this.ray(event).ray.intersectPlane(plane, new Vector3());
    return to ? to.sub(from).divideScalar(RULER) : new Vector3();
  }

  /** Where the torso is on the page [px], for tests. */
  get spot(): { x: number; y: number } {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const seen = this.torso.clone().project(this.eye.view);
    return { x: left + 0.5 * width * (1 + seen.x), y: top + 0.5 * height * (1 - seen.y) };
  }

  /** The point that the camera looks at, which goes with the robot. */
  get ground(): Vector3 {
    return this.place.clone();
  }

  private ray(event: PointerEvent): Raycaster {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const at = new Vector2(
      (2 * (event.clientX - left)) / width - 1,
      1 - (2 * (event.clientY - top)) / height,
    );
    const found = new Raycaster();
    found.setFromCamera(at, this.eye.view);
    return found;
  }

  /** Moves what the camera looks at with the robot; its height follows softly. */
  private follow(pose: Pose): void {
    const { x, y, z } = pose.position;
    const stood = this.world!.robot.torso.size[2];
    const wished = Math.min(this.relief!.height(x, y), z - 0.5 * stood);
    this.torso.copy(pose.position);
    this.place.set(x, y, this.place.z + SOFT * (wished - this.place.z));
  }
}

const MOST_WEIGHTS = 3; // body weights    largest push
const OFTEN = 40; // ms    between two pushes at the most
const RENEW = 300; // ms    between two that are the same

/** Pushes the robot while a pointer drags from it: along the ground, with shift upwards. A click on
 * a leg makes it limp, or healthy again. */
export class Pusher {
  private pointer = -1;
  private offset: Vector3 | undefined;
  private event: PointerEvent | undefined;
  private sent = "";
  private moved = false; // since the pointer went down; else it is a click
  private at = 0;

  constructor(
    private readonly view: View,
    private readonly link: Connection,
    private readonly weight: () => number,
  ) {
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.begin(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"] as const)
      canvas.addEventListener(name, (event) => this.end(event));
  }

  /** Sends the push of a drag that goes on; the robot may move away below the pointer. */
  renew(): void {
    if (this.event) this.send(this.event);
  }

  private begin(event: PointerEvent): void {
    const hit = event.button === 0 ? this.view.hit(event) : undefined;
    if (!hit) return;
    event.stopImmediatePropagation(); // the drag does not turn the view as well
    this.view.canvas.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.offset = hit.clone().sub(this.view.ground);
    this.event = event;
    this.moved = false;
    this.view.canvas.classList.add("pushing");
  }

  private move(event: PointerEvent): void {
    if (event.pointerId === this.pointer) [this.event, this.moved] = [event, true];
    else if (event.buttons === 0)
      this.view.canvas.classList.toggle("grip", this.view.hit(event) !== undefined);
  }

  private end(event: PointerEvent): void {
    if (event.pointerId !== this.pointer) return;
    this.pointer = -1;
    this.event = undefined;
    this.sent = "";
    this.view.canvas.classList.remove("pushing");
    const leg = this.moved ? undefined : this.view.legAt(event);
    if (leg !== undefined) this.link.send({ type: "leg", leg });
    this.link.send({ type: "push", x: 0, y: 0, z: 0 });
  }

  private send(event: PointerEvent): void {
    const now = performance.now();
    if (!this.offset || now - this.at < OFTEN) return;
    const grip = this.offset.clone().add(this.view.ground);
    const share = this.view.pull(event, grip, event.shiftKey).clampLength(0, MOST_WEIGHTS);
    const force = share.multiplyScalar(this.weight());
    const [x, y, z] = force.toArray().map((part) => Math.round(100 * part) / 100);
    const text = JSON.stringify([x, y, z]);
    if (text === this.sent && now - this.at < RENEW) return;
    [this.sent, this.at] = [text, now];
    this.link.send({ type: "push", x, y, z });
  }
}
