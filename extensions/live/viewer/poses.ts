import { Quaternion, Vector3 } from "three";
import type { Pose } from "../../../cosim/viewer/src/kinematics";
import type { Frame } from "./messages";

const BEHIND = 0.03; // s    that the picture is behind the newest frame, so that there is a next one
const SLEW = 0.1; // share of the difference from the wished time that is made up in a picture
const FAR = 0.25; // s    from the wished time, after which the picture jumps to it
const KEPT = 32; // frames

/** Poses between the frames that have arrived, on a clock that runs evenly. */
export class Poses {
  private readonly frames: Frame[] = [];
  private shown = 0;
  private last = performance.now();

  add(frame: Frame): void {
    const newest = this.frames[this.frames.length - 1];
    if (newest && (frame.placed !== newest.placed || frame.time < newest.time))
      this.frames.length = 0;
    this.frames.push(frame);
    if (this.frames.length > KEPT) this.frames.shift();
    if (this.frames.length === 1) this.shown = frame.time - BEHIND;
  }

  get newest(): Frame | undefined {
    return this.frames[this.frames.length - 1];
  }

  /** Advances the clock to now; returns the pose to be drawn, and the frame at or before it. */
  advance(): { pose: Pose; frame: Frame } | undefined {
    const { newest } = this;
    const now = performance.now();
    const passed = (now - this.last) / 1000;
    this.last = now;
    if (!newest) return undefined;
    const wished = newest.time - BEHIND;
    this.shown += passed * Math.min(newest.factor || 1, 1);
    const gap = wished - this.shown;
    this.shown = Math.abs(gap) > FAR ? wished : this.shown + SLEW * gap;
    let k = this.frames.length - 1;
    while (k > 0 && this.frames[k].time > this.shown) k--;
    const [from, to] = [this.frames[k], this.frames[Math.min(k + 1, this.frames.length - 1)]];
    const width = to.time - from.time;
    const share = width > 0 ? Math.min(Math.max((this.shown - from.time) / width, 0), 1) : 0;
    return { pose: between(from, to, share), frame: from };
  }
}

function between(from: Frame, to: Frame, share: number): Pose {
  return {
    position: vector(from.position).lerp(vector(to.position), share),
    attitude: quaternion(from.quaternion).slerp(quaternion(to.quaternion), share),
    angles: Float64Array.from(from.angle, (angle, k) => angle + share * (to.angle[k] - angle)),
  };
}

const vector = ([x, y, z]: readonly number[]): Vector3 => new Vector3(x, y, z);
const quaternion = ([w, x, y, z]: readonly number[]): Quaternion =>
  new Quaternion(x, y, z, w).normalize();
