import { type Color, Vector3 } from "three";
import { poseAt } from "../kinematics";
import type { Recording } from "../recording";
import type { Colours } from "../theme";
import type { PackedRun } from "../types";
import { RobotScene } from "./robot_scene";
import type { Relief } from "./surface";
import { type StancePhase, Trails } from "./trails";

/** The scene of one run: the robot, the ground, forces and trails at a time. */
export class Actor {
  readonly scene: RobotScene;
  /** The point on the ground that the camera looks at. */
  readonly place = new Vector3();
  private trails: Trails | undefined;

  constructor(
    readonly run: PackedRun,
    readonly recording: Recording,
    readonly relief: Relief,
    mark: Color,
  ) {
    this.scene = new RobotScene(run.robot, relief, mark);
  }

  addTrails(stances: readonly StancePhase[], enlarged: number): void {
    this.trails = new Trails(stances, this.recording, this.relief, enlarged, this.run.robot.foot);
    this.scene.add(this.trails);
  }

  paint(colours: Colours): void {
    this.scene.paint(colours);
    this.trails?.paint(colours.contact);
  }

  /** Shows the run at a time; after the end of its recording, the run stays in its last pose. */
  show(time: number): void {
    const pose = poseAt(this.recording, this.run.robot, time);
    this.lookAt(pose.position);
    this.scene.show(pose, this.inContact(time), this.forces(time), this.place);
    this.trails?.show(time);
  }

  /** Returns what is visible now: trails, and the forces [body weights] that arrows show. */
  shown() {
    return { ...this.trails?.shown(), arrows: this.scene.arrows.shown() };
  }

  /**
   * Looks at the ground below the torso. On a surface the height follows that of the torso, because
   * the ground below it may jump.
   */
  private lookAt({ x, y, z }: Vector3): void {
    this.place.set(x, y, this.relief.height(x, y));
    if (!this.relief.surface) return;
    const first = poseAt(this.recording, this.run.robot, this.recording.start).position;
    this.place.z = z - first.z + this.relief.height(first.x, first.y);
  }

  private inContact(time: number): boolean[] {
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
