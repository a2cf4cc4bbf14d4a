/** Where the parts of the module's row of values begin and end (extensions/live/wasm/robot.c). */
const PARTS = {
  time: [0, 1],
  angle: [1, 19],
  torque: [37, 55],
  force: [55, 73],
  slip: [73, 79],
  position: [79, 82],
  quaternion: [82, 86],
  tilt: [86, 88],
  velocity: [89, 92],
  rate: [92, 95],
  push: [149, 152],
} as const;

type State = Readonly<Record<keyof typeof PARTS, readonly number[]>>;

/** The module of the robot with its controller. SI units; legs LF LM LR RF RM RR. */
export class Robot {
  private constructor(private readonly exports: WebAssembly.Exports) {
    this.call("_initialize");
  }

  /** Compiles the module, whose bytes are in base64. */
  static async load(base64: string): Promise<Robot> {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    return new Robot((await WebAssembly.instantiate(bytes, {})).instance.exports);
  }

  /** Calls a function that returns a status. Throws an error with the message of a failure. */
  do(name: string, ...values: number[]): void {
    if (this.call(`hx_page_${name}`, ...values) === 0) return;
    const text = new Uint8Array(this.memory, this.call("hx_page_message"));
    throw new Error(new TextDecoder().decode(text.subarray(0, text.indexOf(0))));
  }

  /** Writes the push, the command or the gait. */
  write(name: string, values: readonly number[]): void {
    new Float64Array(this.memory, this.call(`hx_page_${name}`), values.length).set(values);
  }

  get state(): State {
    const row = new Float64Array(this.memory, this.call("hx_page_values"), PARTS.push[1]);
    const parts = Object.entries(PARTS).map(([name, ends]) => [name, [...row.slice(...ends)]]);
    return Object.fromEntries(parts) as State;
  }

  /** Its buffer changes when the memory grows. */
  private get memory(): ArrayBuffer {
    return (this.exports.memory as WebAssembly.Memory).buffer;
  }

  private call(name: string, ...values: number[]): number {
    return (this.exports[name] as (...values: number[]) => number)(...values);
  }
}
