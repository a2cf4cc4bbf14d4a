import { type Color, DirectionalLight, Fog, HemisphereLight, Scene, Vector3 } from "three";
import { footCentres, type Pose, poseAt } from "../kinematics";
import type { Recording } from "../recording";
import type { Colours } from "../theme";
import type { PackedRun } from "../types";
import { ForceArrows } from "./arrows";
import { Dents } from "./dents";
import { Floor } from "./ground";
import { castShadows } from "./lamp";
import type { Relief } from "./relief";
import { RobotModel } from "./robot";
import type { Stance } from "./stances";
import { Terrain } from "./terrain";
import { type Shown, Trails } from "./trails";

const LAMP = new Vector3(0.9, 1.3, 2.6); // m    position of the lamp relative to the robot
const REACH = 0.55; // m    distance from the robot within which shadows are cast
const FAR_REACH = 1.1; // m    the same on a surface, which casts shadows too

/** The scene of one run: the robot, the ground, forces and trails at a time. */
export class Actor {
  readonly scene = new Scene();
  readonly place = new Vector3();
  private readonly model: RobotModel;
  private readonly floor: Floor | Terrain;
  private readonly dents: Dents;
  private readonly arrows: ForceArrows;
  private readonly lamp = new DirectionalLight("#ffffff", 2.1);
  private readonly sky = new HemisphereLight("#ffffff", "#8d9099", 1.6);
  private trails: Trails | undefined;
  private print: Color | undefined;

  constructor(
    readonly run: PackedRun,
    readonly recording: Recording,
    readonly relief: Relief,
    mark: Color,
  ) {
    this.model = new RobotModel(run.robot, mark);
    const { surface } = relief;
    this.floor = surface ? new Terrain(surface, run.ground.height) : new Floor(relief);
    this.dents = new Dents(run.ground.footprints ?? [], relief);
    this.arrows = new ForceArrows(run.robot.legs.length);
    castShadows(this.lamp, surface ? FAR_REACH : REACH, surface ? 2048 : 1024);
    this.scene.add(this.model, this.floor, this.dents, this.arrows);
    this.scene.add(this.lamp, this.lamp.target, this.sky);
  }

  addTrails(stances: readonly Stance[], enlarged: number): void {
    this.trails = new Trails(stances, this.recording, this.relief, enlarged, this.run.robot.foot);
    if (this.print) this.trails.paint(this.print);
    this.scene.add(this.trails);
  }

  paint(colours: Colours): void {
    this.scene.background = colours.sky;
    this.scene.fog = new Fog(colours.sky, 2.2, 6.5);
    if (this.floor instanceof Terrain) this.floor.paint(colours);
    else this.floor.paint(colours.floor, colours.grid);
    this.dents.paint(colours.soil);
    this.arrows.paint(colours.force);
    this.sky.intensity = colours.dark ? 1.15 : 1.7;
    this.lamp.intensity = colours.dark ? 2.2 : 2.3;
    this.print = colours.print;
    this.trails?.paint(colours.print);
  }

  /** Shows the run at a time; after the end of its recording, the run stays in its last pose. */
  show(time: number): void {
    const pose = this.poseAt(time);
    this.place.copy(this.below(pose));
    this.model.place(pose, this.touching(time));
    this.showForces(pose, time);
    if (this.floor instanceof Floor) this.floor.follow(pose.position.x, pose.position.y);
    this.lamp.target.position.copy(this.place);
    this.lamp.position.copy(this.place).add(LAMP);
    this.trails?.show(time);
    this.dents.show(time);
  }

  poseAt(time: number): Pose {
    return poseAt(this.recording, this.run.robot, time);
  }

  /** Returns what is visible now: trails, lit feet, forces [body weights] shown by arrows. */
  shown(): {
    trails: Shown;
    lit: boolean[];
    arrows: number[][];
    triangles: number;
    dents: number;
  } {
    return {
      trails: this.trails?.shown() ?? { prints: 0, pieces: 0, latest: null },
      lit: this.model.lit(),
      arrows: this.arrows.shown(),
      triangles: this.floor instanceof Terrain ? this.floor.triangles : 0,
      dents: this.dents.count,
    };
  }

  /**
   * Returns the point on the ground that the camera looks at. On a surface its height follows that
   * of the torso, because the ground below the torso may jump.
   */
  private below(pose: Pose): Vector3 {
    const { x, y, z } = pose.position;
    if (!this.relief.surface) return new Vector3(x, y, this.relief.height(x, y));
    const first = this.poseAt(this.recording.start).position;
    return new Vector3(x, y, z - first.z + this.relief.height(first.x, first.y));
  }

  private touching(time: number): boolean[] {
    const { row } = this.recording.place(time);
    return this.run.robot.legs.map(
      ({ name }) =>
        this.recording.has(`${name}.contact`) &&
        this.recording.column(`${name}.contact`)[row] > 0.5,
    );
  }

  private showForces(pose: Pose, time: number): void {
    const soles = footCentres(this.run.robot, pose).map((foot) =>
      foot.addScaledVector(this.relief.normal(foot.x, foot.y), -this.run.robot.foot),
    );
    const forces = this.run.robot.legs.map(({ name }) => {
      const axes = ["x", "y", "z"].map((axis) => `${name}.force.${axis}`);
      return this.recording.has(...axes)
        ? new Vector3(...axes.map((axis) => this.recording.value(axis, time)))
        : new Vector3();
    });
    this.arrows.show(soles, forces);
  }
}
