import uPlot from "uplot";
import type { Clock } from "../clock";
import { element, fixed } from "../dom";
import { property, quietAxis } from "../theme";

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

  show(low: number, width: number): void {
    const whole = this.end - this.start;
    this.width = Math.min(width, whole);
    this.low = Math.min(Math.max(low, this.start), this.end - this.width);
    this.high = this.low + this.width;
    for (const listener of this.listeners) listener();
  }
}

const LEAST = 1e-4; // relative: a curve with a smaller range is a constant with round-off

/** A curve, and what its plot's heading shows of it. */
export interface Curve {
  readonly label: string;
  /** Name of the page's custom property that holds the colour. */
  readonly colour: string;
  readonly dash?: readonly number[];
  readonly time: ArrayLike<number>;
  readonly values: ArrayLike<number>;
  /** Returns the value at a time, for the heading. */
  at(time: number): number;
}

export interface PanelOptions {
  readonly title: string;
  readonly unit: string;
  readonly height: number;
  readonly curves: readonly Curve[];
  readonly host: HTMLElement;
  /** Least and largest value, for plots that share a scale. */
  readonly limits?: readonly [number, number] | undefined;
}

/** A plot with a cursor at the replay's time; pressing or dragging in it moves the replay. */
export class Panel {
  private readonly plot: uPlot;
  private readonly playhead = element("div", "playhead");
  private readonly readouts: HTMLElement[];

  constructor(
    private readonly options: PanelOptions,
    private readonly clock: Clock,
    private readonly span: Span,
  ) {
    const { host, title, unit, curves } = options;
    const { values, box } = makeFigure(host, title, unit, curves);
    this.readouts = values;
    this.plot = new uPlot(this.describe(box), dataOf(curves), box);
    this.plot.over.append(this.playhead);
    this.listenToPointer();
    new ResizeObserver(() => this.resize(box)).observe(box);
    span.listen(() => this.showSpan());
    clock.listen(() => this.showTime());
  }

  /** Draws the plot again in the page's present colours. */
  repaint(): void {
    this.plot.redraw(false, true);
  }

  private describe(box: HTMLElement): uPlot.Options {
    const [min, max] = this.span.limits;
    const again = () => queueMicrotask(() => this.showTime()); // after uPlot's own layout microtask
    const quiet = quietAxis();
    return {
      width: Math.max(box.clientWidth, 120),
      height: this.options.height,
      legend: { show: false },
      cursor: { show: false },
      padding: [6, 8, 0, 0],
      scales: {
        x: { time: false, min, max },
        y: {
          range: (_, low, high) =>
            roomy(...(this.options.limits ?? ([low ?? 0, high ?? 1] as const))),
        },
      },
      axes: [
        { ...quiet, size: 22, gap: 3, space: 60 },
        { ...quiet, size: 46, gap: 4, space: 26 },
      ],
      series: [{}, ...this.options.curves.map(seriesOf)],
      hooks: { ready: [again], setScale: [again], setSize: [again] },
    };
  }

  private showTime(): void {
    const left = this.plot.valToPos(this.clock.time, "x");
    const seen = left >= -0.5 && left <= this.plot.over.clientWidth + 0.5;
    this.playhead.style.display = seen ? "" : "none";
    this.playhead.style.transform = `translateX(${left}px)`;
    this.options.curves.forEach((curve, k) => {
      this.readouts[k].textContent = figures(curve.at(this.clock.time));
    });
  }

  private showSpan(): void {
    const [min, max] = this.span.limits;
    this.plot.setScale("x", { min, max });
  }

  private resize(box: HTMLElement): void {
    if (box.clientWidth > 0 && box.clientWidth !== this.plot.width) {
      this.plot.setSize({ width: box.clientWidth, height: this.options.height });
    }
  }

  private listenToPointer(): void {
    const over = this.plot.over;
    const timeOf = (event: MouseEvent) =>
      this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
    over.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      over.setPointerCapture(event.pointerId);
      this.clock.pause();
      this.clock.seek(timeOf(event));
    });
    over.addEventListener("pointermove", (event) => {
      if (over.hasPointerCapture(event.pointerId)) this.clock.seek(timeOf(event));
    });
  }
}

/** Adds a plot's figure to a host: its heading, the elements of its curves' values, and its box. */
function makeFigure(
  host: HTMLElement,
  name: string,
  unit: string,
  curves: readonly Curve[],
): { values: HTMLElement[]; box: HTMLElement } {
  const figure = element("figure", "panel");
  const heading = element("figcaption", "panel-title");
  const title = element("span", "panel-name", name);
  title.append(element("span", "panel-unit", ` ${unit}`));
  const readouts = element("div", "readouts"); // which wrap into a row of their own together
  const values = curves.map(({ label, colour, dash }) => {
    const item = element("span", "readout");
    const mark = element("i", dash ? "mark dashed" : "mark");
    mark.style.setProperty("--mark", `var(${colour})`);
    const value = element("b", "value");
    item.append(mark, element("span", "curve-name", label), value);
    readouts.append(item);
    return value;
  });
  const box = element("div", "panel-box");
  heading.append(title, readouts);
  figure.append(heading, box);
  host.append(figure);
  return { values, box };
}

function seriesOf(curve: Curve): uPlot.Series {
  return {
    label: curve.label,
    stroke: () => property(curve.colour),
    width: 1.6,
    points: { show: false },
    ...(curve.dash ? { dash: [...curve.dash] } : {}),
  };
}

/** Returns the curves at the times of all of them. */
function dataOf(curves: readonly Curve[]): uPlot.AlignedData {
  return uPlot.join(
    curves.map((curve) => [Array.from(curve.time), Array.from(curve.values)] as uPlot.AlignedData),
  );
}

/** Returns limits with a margin above and below, also for a constant. */
function roomy(from: number, to: number): uPlot.Range.MinMax {
  const size = Math.max(Math.abs(from), Math.abs(to));
  const margin =
    to - from > LEAST * size
      ? Math.max(0.07 * (to - from), 0.5 * LEAST)
      : Math.max(0.1 * size, 0.5);
  return [from >= 0 && from < 0.3 * (to - from) ? 0 : from - margin, to + margin];
}

/** Returns a value as text with about three digits. */
function figures(value: number): string {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  return fixed(value, digits);
}
