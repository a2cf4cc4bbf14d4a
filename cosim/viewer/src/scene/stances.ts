import type { Vector3 } from "three";
import { footCentres, poseAt } from "../kinematics";
import type { Recording } from "../recording";
import type { Robot } from "../types";
import type { Relief } from "./relief";

const MOST_POINTS = 60; // of a trail

/**
 * A foot on the ground from touch-down to lift-off: where, and how far it has slipped since
 * touch-down, row by row.
 */
export interface Stance {
  readonly place: Vector3;
  readonly rows: readonly number[];
  readonly slipped: readonly { readonly x: number; readonly y: number }[];
}

/** Returns all stances of all feet; [] when the recording lacks the columns. */
export function findStances(recording: Recording, robot: Robot, relief: Relief): Stance[] {
  return robot.legs.flatMap((leg, index) => {
    const names = [
      `${leg.name}.contact`,
      `${leg.name}.slipped.x`,
      `${leg.name}.slipped.y`,
    ] as const;
    if (!recording.has(...names, "torso.x", "torso.qw", `${leg.name}.coxa.angle`)) return [];
    const [contact, x, y] = names.map((name) => recording.column(name));
    return spans(contact).map(([begin, end]) => {
      const foot = footCentres(robot, poseAt(recording, robot, recording.time[begin]))[index];
      const place = relief.mark(foot, robot.foot);
      const rows = sampled(begin, end);
      return {
        place,
        rows,
        slipped: rows.map((row) => ({ x: x[row] - x[begin], y: y[row] - y[begin] })),
      };
    });
  });
}

/** Returns the first and last row of every period in which a flag is on. */
function spans(flag: Float32Array): [number, number][] {
  const found: [number, number][] = [];
  let begin = -1;
  for (let k = 0; k <= flag.length; k++) {
    const up = k < flag.length && flag[k] > 0.5;
    if (up && begin < 0) begin = k;
    if (!up && begin >= 0) {
      found.push([begin, k - 1]);
      begin = -1;
    }
  }
  return found;
}

function sampled(begin: number, end: number): number[] {
  const count = Math.min(end - begin + 1, MOST_POINTS);
  return Array.from({ length: count }, (_, k) =>
    Math.round(begin + ((end - begin) * k) / Math.max(count - 1, 1)),
  );
}

/** Returns how far a stance's foot slipped in total [m]. */
export function slippedBy(stance: Stance): number {
  const last = stance.slipped[stance.slipped.length - 1];
  return Math.hypot(last.x, last.y);
}
