import type { Packed } from "./types";

/** The unpacked columns of a run by name, and the search for times among its rows. */
export class Recording {
  constructor(
    readonly time: Float64Array,
    private readonly columns: ReadonlyMap<string, Float32Array>,
  ) {}

  get start(): number {
    return this.time[0] ?? 0;
  }

  get end(): number {
    return this.time[this.time.length - 1] ?? 0;
  }

  has(...names: string[]): boolean {
    return names.every((name) => this.columns.has(name));
  }

  /** Returns a column; throws when it was not recorded. */
  column(name: string): Float32Array {
    const found = this.columns.get(name);
    if (!found) throw new Error(`no column ${name} in the recording`);
    return found;
  }

  /** Returns the row at or before a time, and the share (0 to 1) of the way to the next row. */
  place(time: number): { row: number; share: number } {
    let low = 0;
    let high = this.time.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= time) low = middle;
      else high = middle;
    }
    const width = this.time[high] - this.time[low];
    const share = width > 0 ? (time - this.time[low]) / width : 0;
    return { row: low, share: Math.min(Math.max(share, 0), 1) };
  }

  /** Returns the value of a column at a time, interpolated linearly. */
  value(name: string, time: number): number {
    const values = this.column(name);
    const { row, share } = this.place(time);
    const next = Math.min(row + 1, values.length - 1);
    return values[row] + share * (values[next] - values[row]);
  }
}

/** Unpacks what cosim/report/columns.py has packed. */
export async function unpack(run: Packed): Promise<Recording> {
  const planes = await inflate(run.data);
  const size = run.rows * (run.columns.length + 2);
  const steps = new Uint16Array(size);
  for (let column = 0; column < run.columns.length + 2; column++) {
    let sum = 0;
    for (let k = column * run.rows; k < (column + 1) * run.rows; k++) {
      sum = (sum + planes[k] + 256 * planes[size + k]) & 0xffff;
      steps[k] = sum;
    }
  }
  const time = new Float64Array(run.rows);
  for (let k = 0; k < run.rows; k++)
    time[k] = run.start + run.tick * (steps[k] + 65536 * steps[run.rows + k]);
  const columns = new Map<string, Float32Array>();
  run.columns.forEach(([name, scale, offset], index) => {
    const first = (index + 2) * run.rows;
    columns.set(
      name,
      Float32Array.from(steps.subarray(first, first + run.rows), (step) => offset + scale * step),
    );
  });
  return new Recording(time, columns);
}

/** Returns the bytes of a base64 text that zlib compressed. */
async function inflate(text: string): Promise<Uint8Array> {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
