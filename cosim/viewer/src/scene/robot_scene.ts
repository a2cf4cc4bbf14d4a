import { type Color, DirectionalLight, Fog, HemisphereLight, Scene, Vector3 } from "three";
import { footCentres, type Pose } from "../kinematics";
import type { Colours } from "../theme";
import type { Robot } from "../types";
import { ForceArrows } from "./arrows";
import { Floor } from "./ground";
import { RobotModel } from "./robot";
import type { Relief } from "./surface";
import { Terrain } from "./terrain";

const LAMP = new Vector3(0.9, 1.3, 2.6); // m    position of the lamp relative to the robot
const REACH = 1; // m    distance from the robot within which shadows are cast
const TEXELS = 2048; // of the map of shadows

/** A robot on its ground in the light of a lamp, with the forces on its feet. */
export class RobotScene extends Scene {
  readonly model: RobotModel;
  readonly floor: Floor | Terrain;
  readonly arrows: ForceArrows;
  private readonly lamp = new DirectionalLight("#ffffff", 2.1);
  private readonly sky = new HemisphereLight("#ffffff", "#8d9099", 1.6);

  constructor(
    private readonly robot: Robot,
    private readonly relief: Relief,
    mark: Color,
  ) {
    super();
    this.model = new RobotModel(robot, mark);
    const { surface, plane } = relief;
    this.floor = surface ? new Terrain(surface, plane.height) : new Floor(relief);
    this.arrows = new ForceArrows(robot.legs.length);
    this.castShadows();
    this.add(this.model, this.floor, this.arrows, this.lamp, this.lamp.target, this.sky);
  }

  paint(colours: Colours): void {
    this.background = colours.sky;
    this.fog = new Fog(colours.sky, 2.2, 6.5);
    this.floor.paint(colours);
    this.arrows.paint(colours.force);
    this.sky.intensity = colours.dark ? 1.15 : 1.7;
    this.lamp.intensity = colours.dark ? 2.2 : 2.3;
  }

  /** Shows a pose, forces on the feet [body weights], and the lamp above a place. */
  show(
    pose: Pose,
    inContact: readonly boolean[],
    forces: readonly Vector3[],
    place: Vector3,
  ): void {
    this.model.place(pose, inContact);
    const soles = footCentres(this.robot, pose).map((foot) =>
      foot.addScaledVector(this.relief.normal(foot.x, foot.y), -this.robot.foot),
    );
    this.arrows.show(soles, forces);
    if (this.floor instanceof Floor) this.floor.follow(pose.position.x, pose.position.y);
    this.lamp.target.position.copy(place);
    this.lamp.position.copy(place).add(LAMP);
  }

  private castShadows(): void {
    const { shadow } = this.lamp;
    this.lamp.castShadow = true;
    shadow.mapSize.set(TEXELS, TEXELS);
    Object.assign(shadow, { radius: 4, intensity: 0.6, normalBias: 0.004 });
    const sides = { left: -REACH, right: REACH, top: REACH, bottom: -REACH };
    Object.assign(shadow.camera, { ...sides, near: 0.5, far: 6 });
  }
}
