import { Quaternion, Vector3 } from "three";
import type { Recording } from "./recording";
import type { Leg, Robot, Vector } from "./types";

/** Position and attitude of the torso, and the joint angles [rad]. */
export interface Pose {
  readonly position: Vector3;
  readonly attitude: Quaternion;
  /** (18) joints of the first leg first */
  readonly angles: Float64Array;
}

/** Returns the pose at a time, interpolated between rows: attitudes by slerp, the rest linearly. */
export function poseAt(recording: Recording, robot: Robot, time: number): Pose {
  const at = (name: string) => recording.value(name, time);
  const { row, share } = recording.place(time);
  const attitude = attitudeOf(recording, row).slerp(
    attitudeOf(recording, Math.min(row + 1, recording.time.length - 1)),
    share,
  );
  const names = robot.legs.flatMap((leg) =>
    robot.joints.map((joint) => `${leg.name}.${joint}.angle`),
  );
  return {
    position: new Vector3(at("torso.x"), at("torso.y"), at("torso.z")),
    attitude,
    angles: Float64Array.from(names, at),
  };
}

function attitudeOf(recording: Recording, row: number): Quaternion {
  const part = (name: string) => recording.column(`torso.q${name}`)[row];
  return new Quaternion(part("x"), part("y"), part("z"), part("w")).normalize();
}

export const toVector3 = (vector: Vector): Vector3 => new Vector3(...vector);

/** Returns the torso's origin from the position of its centre of mass. */
export function torsoOrigin(robot: Robot, pose: Pose): Vector3 {
  return toVector3(robot.torso.com).applyQuaternion(pose.attitude).negate().add(pose.position);
}

/**
 * Returns hip, knee, ankle and foot of a leg in the world. As in models/kinematics.py, each link's
 * tip is given in the link's own frame.
 */
export function legPoints(robot: Robot, pose: Pose, index: number): Vector3[] {
  const leg: Leg = robot.legs[index];
  const turn = pose.attitude.clone();
  turn.multiply(new Quaternion().setFromAxisAngle(new Vector3(0, 0, 1), leg.yaw));
  const point = toVector3(leg.hip).applyQuaternion(pose.attitude).add(torsoOrigin(robot, pose));
  const points = [point.clone()];
  leg.links.forEach((link, joint) => {
    const angle = pose.angles[leg.links.length * index + joint];
    turn.multiply(new Quaternion().setFromAxisAngle(toVector3(link.axis).normalize(), angle));
    point.add(toVector3(link.tip).applyQuaternion(turn));
    points.push(point.clone());
  });
  return points;
}

/** Returns the centres of the six feet in the world. */
export function footCentres(robot: Robot, pose: Pose): Vector3[] {
  return robot.legs.map((_, index) => legPoints(robot, pose, index)[3]);
}
