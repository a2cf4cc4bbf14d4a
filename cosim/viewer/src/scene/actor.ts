import { type Color, Vector3 } from "three";
import { type Pose, poseAt } from "../kinematics";
import type { Recording } from "../recording";
import type { Colours } from "../theme";
import type { PackedRun } from "../types";
import { Dents } from "./dents";
import { RobotScene } from "./robot_scene";
import type { Relief } from "./surface";
import { Terrain } from "./terrain";
import { type Shown, type Stance, Trails } from "./trails";

/** The scene of one run: the robot, the ground, forces and trails at a time. */
export class Actor {
  readonly scene: RobotScene;
  readonly place = new Vector3();
  private readonly dents: Dents;
  private trails: Trails | undefined;
  private print: Color | undefined;

  constructor(
    readonly run: PackedRun,
    readonly recording: Recording,
    readonly relief: Relief,
    mark: Color,
  ) {
    this.scene = new RobotScene(run.robot, relief, mark);
    this.dents = new Dents(run.ground.footprints ?? [], relief);
    this.scene.add(this.dents);
  }

  addTrails(stances: readonly Stance[], enlarged: number): void {
    this.trails = new Trails(stances, this.recording, this.relief, enlarged, this.run.robot.foot);
    if (this.print) this.trails.paint(this.print);
    this.scene.add(this.trails);
  }

  paint(colours: Colours): void {
    this.scene.paint(colours);
    this.dents.paint(colours.soil);
    this.print = colours.print;
    this.trails?.paint(colours.print);
  }

  /** Shows the run at a time; after the end of its recording, the run stays in its last pose. */
  show(time: number): void {
    const pose = this.poseAt(time);
    this.place.copy(this.below(pose));
    this.scene.show(pose, this.touching(time), this.forces(time), this.place);
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
    const { floor, model, arrows } = this.scene;
    return {
      trails: this.trails?.shown() ?? { prints: 0, pieces: 0, latest: null },
      lit: model.lit(),
      arrows: arrows.shown(),
      triangles: floor instanceof Terrain ? floor.triangles : 0,
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

  private forces(time: number): Vector3[] {
    return this.run.robot.legs.map(({ name }) => {
      const axes = ["x", "y", "z"].map((axis) => `${name}.force.${axis}`);
      return this.recording.has(...axes)
        ? new Vector3(...axes.map((axis) => this.recording.value(axis, time)))
        : new Vector3();
    });
  }
}
