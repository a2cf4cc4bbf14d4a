import {
  Color,
  DirectionalLight,
  Fog,
  HemisphereLight,
  Plane,
  Quaternion,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  type WebGLRenderer,
} from "three";
import { footCentres, type Pose } from "../../../cosim/viewer/src/kinematics";
import { ForceArrows } from "../../../cosim/viewer/src/scene/arrows";
import { Eye, makeRenderer } from "../../../cosim/viewer/src/scene/camera";
import { Floor } from "../../../cosim/viewer/src/scene/ground";
import { castShadows } from "../../../cosim/viewer/src/scene/lamp";
import { Relief } from "../../../cosim/viewer/src/scene/relief";
import { RobotModel } from "../../../cosim/viewer/src/scene/robot";
import { unpackSurface } from "../../../cosim/viewer/src/scene/surface";
import { Terrain } from "../../../cosim/viewer/src/scene/terrain";
import { property, readColours } from "../../../cosim/viewer/src/theme";
import type { Frame, World } from "./messages";

const EYE = new Vector3(-0.86, -0.68, 0.56); // m    of the camera, from the robot: behind, to the right
const LOOK = new Vector3(0.06, 0, 0.04); // m    target of the camera, above the ground
const LAMP = new Vector3(0.9, 1.3, 2.6); // m    from the robot
const REACH = 1.0; // m    from the robot within which shadows are cast
const SOFT = 0.15; // share of the way to the robot's height that the camera goes in a picture
const RULER = 0.42; // m    of dragging for a push of one body weight, as long as its arrow

/** The robot on its ground, in one scene, seen by a camera that goes along. */
export class View {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly eye: Eye;
  private readonly lamp = new DirectionalLight("#ffffff", 2.1);
  private readonly sky = new HemisphereLight("#ffffff", "#8d9099", 1.6);
  private readonly push = new ForceArrows(1);
  private readonly anchor = new Vector3();
  private world: World | undefined;
  private relief = new Relief({ height: 0, rise: 0, heading: 0 });
  private model: RobotModel | undefined;
  private floor: Floor | Terrain | undefined;
  private forces: ForceArrows | undefined;
  private readonly place = new Vector3();
  private readonly torso = new Vector3();
  private high: number | undefined;
  /** Number of pictures that were drawn. */
  drawn = 0;

  /** Throws when the browser has no WebGL. */
  constructor(private readonly host: HTMLElement) {
    this.renderer = makeRenderer(host);
    this.eye = new Eye(this.renderer.domElement, EYE, LOOK);
    this.light();
    this.push.show([new Vector3()], [new Vector3()]);
    this.scene.add(this.push);
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  /** Builds robot and ground. */
  async build(world: World): Promise<void> {
    const surfaces = await Promise.all(world.surfaces.map(unpackSurface));
    this.world = world;
    for (const old of [this.model, this.floor, this.forces]) if (old) this.scene.remove(old);
    this.relief = new Relief(world.ground, surfaces[world.ground.surface ?? -1]);
    const { surface } = this.relief;
    this.floor = surface ? new Terrain(surface, world.ground.height) : new Floor(this.relief);
    this.model = new RobotModel(world.robot, new Color(property("--accent")));
    this.forces = new ForceArrows(world.robot.legs.length);
    this.high = undefined;
    this.scene.add(this.floor, this.model, this.forces);
    this.paint();
  }

  /** Takes the page's present colours. */
  paint(): void {
    const colours = readColours();
    this.scene.background = colours.sky;
    this.scene.fog = new Fog(colours.sky, 2.2, 6.5);
    if (this.floor instanceof Terrain) this.floor.paint(colours);
    else this.floor?.paint(colours.floor, colours.grid);
    this.forces?.paint(colours.force);
    this.push.paint(new Color(property("--push")));
    this.sky.intensity = colours.dark ? 1.15 : 1.7;
    this.lamp.intensity = colours.dark ? 2.2 : 2.3;
  }

  /** Draws the robot with its forces and contacts as of a frame. */
  draw(frame: Frame): void {
    const { world } = this;
    if (!world || !this.model || !this.forces) return;
    const [w, x, y, z] = frame.quaternion;
    const pose: Pose = {
      position: new Vector3(...frame.position),
      attitude: new Quaternion(x, y, z, w).normalize(),
      angles: Float64Array.from(frame.angle),
    };
    this.model.place(
      pose,
      frame.contact.map((flag) => flag > 0),
    );
    this.showForces(pose, frame);
    this.follow(pose);
    this.showPush(pose, frame, world.weight);
    this.render();
  }

  /** Returns where a pointer's ray meets the robot; undefined beside it. */
  hit(event: PointerEvent): Vector3 | undefined {
    if (!this.model) return undefined;
    return this.ray(event).intersectObject(this.model, true)[0]?.point;
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

  private showForces(pose: Pose, frame: Frame): void {
    const { robot } = this.world!;
    const soles = footCentres(robot, pose).map((foot) =>
      foot.addScaledVector(this.relief.normal(foot.x, foot.y), -robot.foot),
    );
    const forces = robot.legs.map((_, k) => new Vector3(...frame.force.slice(3 * k, 3 * k + 3)));
    this.forces?.show(soles, forces);
  }

  private showPush(pose: Pose, frame: Frame, weight: number): void {
    this.push.show([pose.position], [new Vector3(...frame.push).divideScalar(weight)]);
  }

  /** Moves camera, lamp and floor with the robot; their height follows softly. */
  private follow(pose: Pose): void {
    const { x, y, z } = pose.position;
    const stood = this.world!.robot.torso.size[2];
    const wished = Math.min(this.relief.height(x, y), z - 0.5 * stood);
    this.high = this.high === undefined ? wished : this.high + SOFT * (wished - this.high);
    this.place.set(x, y, this.high);
    this.torso.copy(pose.position);
    this.anchor.copy(this.place);
    if (this.floor instanceof Floor) this.floor.follow(x, y);
    this.lamp.target.position.copy(this.place);
    this.lamp.position.copy(this.place).add(LAMP);
  }

  private render(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.eye.lookFrom(this.anchor, width / height);
    this.renderer.render(this.scene, this.eye.view);
    this.drawn += 1;
  }

  private light(): void {
    castShadows(this.lamp, REACH, 2048);
    this.scene.add(this.lamp, this.lamp.target, this.sky);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    this.renderer.setSize(width, height, false);
  }
}
