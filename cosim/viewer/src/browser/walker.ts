/**
 * The module of the robot with its controller (extensions/live/wasm/walker.h): its functions, and views of its
 * memory. SI units; legs LF LM LR RF RM RR.
 */

const LEGS = 6;
const JOINTS = 3;

/** Lengths of the parts of hxFrame, in their order. */
const PARTS = {
  time: 1,
  position: 3,
  quaternion: 4,
  velocity: 3,
  rate: 3,
  angle: LEGS * JOINTS,
  contact: LEGS,
  force: LEGS * 3,
  slip: LEGS,
  torque: 1,
  changing: 1,
} as const;

type Part = keyof typeof PARTS;
export type State = { readonly [P in Part]: readonly number[] };

/** hxControl, hxPattern and the numbers of a gait, in the order of hxWalk. */
export type Walk = readonly [number, number, number, number, number, number];

interface Exports extends WebAssembly.Exports {
  readonly memory: WebAssembly.Memory;
  _initialize(): void;
  hx_walker_start(friction: number): number;
  hx_walker_command(forward: number, left: number, turn: number, height: number): void;
  hx_walker_push(x: number, y: number, z: number): void;
  hx_walker_change(): number;
  hx_walker_set_friction(friction: number): number;
  hx_walker_advance(steps: number): number;
  hx_walker_macro_step(): number;
  hx_walker_frame(): number;
  hx_walker_wanted(): number;
  hx_walker_message(): number;
}

/** A call failed; the message is the plant's or the controller's. */
export class WalkerError extends Error {}

export class Walker {
  /** Macro-step [s]. */
  readonly step: number;

  private constructor(private readonly exports: Exports) {
    exports._initialize();
    this.step = exports.hx_walker_macro_step();
  }

  /** Compiles the module, whose bytes are in base64. */
  static async load(base64: string): Promise<Walker> {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Walker(instance.exports as Exports);
  }

  /** Places the robot at its start. Throws WalkerError. */
  start(walk: Walk, friction: number): void {
    this.want(walk);
    this.check(this.exports.hx_walker_start(friction));
  }

  /** Changes control and gait while the robot walks: the control at once. Throws WalkerError. */
  change(walk: Walk): void {
    this.want(walk);
    this.check(this.exports.hx_walker_change());
  }

  setFriction(friction: number): void {
    this.check(this.exports.hx_walker_set_friction(friction));
  }

  command(forward: number, left: number, turn: number, height: number): void {
    this.exports.hx_walker_command(forward, left, turn, height);
  }

  push(x: number, y: number, z: number): void {
    this.exports.hx_walker_push(x, y, z);
  }

  /** Advances by macro-steps. Throws WalkerError. */
  advance(steps: number): void {
    this.check(this.exports.hx_walker_advance(steps));
  }

  get state(): State {
    let place = this.exports.hx_walker_frame();
    const found: Partial<Record<Part, number[]>> = {};
    for (const [name, length] of Object.entries(PARTS)) {
      found[name as Part] = Array.from(this.numbers(place, length));
      place += 8 * length;
    }
    return found as State;
  }

  private want(walk: Walk): void {
    this.numbers(this.exports.hx_walker_wanted(), walk.length).set(walk);
  }

  /** The memory's buffer changes when the memory grows: views are made anew. */
  private numbers(place: number, length: number): Float64Array {
    return new Float64Array(this.exports.memory.buffer, place, length);
  }

  private check(status: number): void {
    if (status !== 0) throw new WalkerError(this.message());
  }

  private message(): string {
    const bytes = new Uint8Array(this.exports.memory.buffer, this.exports.hx_walker_message());
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }
}
