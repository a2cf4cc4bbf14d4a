export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4] as const;

/** The time that replay and plots share. It plays, stops at the end, and notifies its listeners. */
export class Clock {
  private now: number;
  private running = false;
  private rate = 1;
  private readonly listeners: (() => void)[] = [];

  constructor(
    readonly start: number,
    readonly end: number,
  ) {
    this.now = start;
  }

  get time(): number {
    return this.now;
  }

  get playing(): boolean {
    return this.running;
  }

  get speed(): number {
    return this.rate;
  }

  listen(listener: () => void): void {
    this.listeners.push(listener);
  }

  seek(time: number): void {
    this.now = Math.min(Math.max(time, this.start), this.end);
    this.notify();
  }

  /** Advances by seconds of real time while playing. */
  advance(seconds: number): void {
    if (!this.running) return;
    this.now = Math.min(this.now + this.rate * seconds, this.end);
    if (this.now >= this.end) this.running = false;
    this.notify();
  }

  /** Starts playing; at the end it plays from the start again. */
  play(): void {
    if (this.now >= this.end) this.now = this.start;
    this.running = true;
    this.notify();
  }

  pause(): void {
    this.running = false;
    this.notify();
  }

  toggle(): void {
    if (this.running) this.pause();
    else this.play();
  }

  /** Changes to the next faster (+1) or slower (-1) of SPEEDS. */
  changeSpeed(direction: number): void {
    const place = SPEEDS.indexOf(this.rate as (typeof SPEEDS)[number]);
    this.setSpeed(SPEEDS[Math.min(Math.max(place + direction, 0), SPEEDS.length - 1)]);
  }

  setSpeed(speed: number): void {
    this.rate = speed;
    this.notify();
  }

  private notify(): void {
    for (const listener of this.listeners) listener();
  }
}
