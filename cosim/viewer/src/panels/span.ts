/** The interval of time that a group of plots shows; it moves on with the replay, page by page. */
export class Span {
  private low: number;
  private high: number;
  private readonly listeners: (() => void)[] = [];

  constructor(
    private readonly start: number,
    private readonly end: number,
    private width: number,
  ) {
    this.low = start;
    this.high = Math.min(start + width, end);
  }

  get limits(): readonly [number, number] {
    return [this.low, this.high];
  }

  listen(listener: () => void): void {
    this.listeners.push(listener);
  }

  /** Moves the interval so that it contains a time. */
  follow(time: number): void {
    if (time >= this.low && time <= this.high) return;
    this.show(time > this.high ? time - 0.1 * this.width : time - 0.5 * this.width, this.width);
  }

  /** Makes the interval wider (factor above 1) or narrower; `about` is the fixed time. */
  zoom(factor: number, about: number): void {
    const width = Math.min(Math.max(this.width * factor, 0.02), this.end - this.start);
    this.show(about - ((about - this.low) / (this.high - this.low)) * width, width);
  }

  show(low: number, width: number): void {
    const whole = this.end - this.start;
    this.width = Math.min(width, whole);
    this.low = Math.min(Math.max(low, this.start), this.end - this.width);
    this.high = this.low + this.width;
    for (const listener of this.listeners) listener();
  }
}
