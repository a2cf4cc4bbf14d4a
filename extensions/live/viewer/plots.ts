import uPlot from "uplot";
import { fixed, type Labelled, makeFigure } from "../../../cosim/viewer/src/dom";
import { property, quietAxis } from "../../../cosim/viewer/src/theme";
import { type Frame, footForces, speedOf } from "./messages";

const WIDTH = 8; // s    that the plots show
const SLOWEST = 45; // ms    between two drawings
const DEGREES = 180 / Math.PI;
const LEGS = ["LF", "LM", "LR", "RF", "RM", "RR"];

interface Curve extends Labelled {
  value(frame: Frame): number;
}

interface Described {
  readonly name: string;
  readonly unit: string;
  /** Least range of the axis. */
  readonly least: readonly [number, number];
  readonly digits: number;
  readonly curves: readonly Curve[];
}

const STRIPS: readonly Described[] = [
  {
    name: "Foot forces",
    unit: "body weights",
    least: [0, 0.6],
    digits: 2,
    curves: LEGS.map((label, k) => ({
      label,
      colour: `--leg${k}`,
      value: (frame) => Math.hypot(...footForces(frame)[k]),
    })),
  },
  {
    name: "Speed",
    unit: "mm/s",
    least: [-60, 120],
    digits: 0,
    curves: [
      { label: "commanded", colour: "--commanded", value: (f) => 1e3 * f.command[0] },
      { label: "forward", colour: "--curve1", value: (f) => 1e3 * speedOf(f)[0] },
      { label: "left", colour: "--curve2", value: (f) => 1e3 * speedOf(f)[1] },
    ],
  },
  {
    name: "Attitude",
    unit: "degrees",
    least: [-3, 3],
    digits: 1,
    curves: [
      { label: "roll", colour: "--curve1", value: (f) => DEGREES * f.attitude[0] },
      { label: "pitch", colour: "--curve2", value: (f) => DEGREES * f.attitude[1] },
    ],
  },
  {
    name: "Slip",
    unit: "mm/s",
    least: [0, 40],
    digits: 0,
    curves: [
      {
        label: "fastest foot",
        colour: "--curve3",
        value: (f) => 1e3 * Math.max(...footForces(f).map(([, , up], k) => (up ? f.slip[k] : 0))),
      },
    ],
  },
];

/** Plots that run along: the last seconds of a few quantities. */
export class Plots {
  private readonly strips: Strip[];
  private drawn = 0;
  private placed = -1;

  constructor(host: HTMLElement) {
    this.strips = STRIPS.map((about) => new Strip(about, host));
  }

  add(frame: Frame): void {
    if (frame.placed !== this.placed) for (const strip of this.strips) strip.clear();
    this.placed = frame.placed;
    for (const strip of this.strips) strip.add(frame);
  }

  /** Draws what is new, not more often than it can be seen. */
  draw(): void {
    const now = performance.now();
    if (now - this.drawn < SLOWEST) return;
    this.drawn = now;
    for (const strip of this.strips) strip.draw();
  }

  repaint(): void {
    for (const strip of this.strips) strip.plot.redraw(false, true);
  }
}

/** One plot, with the newest values in its heading. */
class Strip {
  readonly plot: uPlot;
  private readonly data: number[][];
  private readonly values: HTMLElement[];

  constructor(
    private readonly about: Described,
    host: HTMLElement,
  ) {
    const { values, box } = makeFigure(host, about.name, about.unit, about.curves);
    this.values = values;
    this.data = [[], ...about.curves.map(() => [])];
    this.plot = new uPlot(this.describe(), this.data as uPlot.AlignedData, box);
    new ResizeObserver(() => {
      const { clientWidth: width, clientHeight: height } = box;
      if (width > 0 && height > 0) this.plot.setSize({ width, height });
    }).observe(box);
  }

  add(frame: Frame): void {
    this.data[0].push(frame.time);
    this.about.curves.forEach((curve, k) => {
      this.data[k + 1].push(curve.value(frame));
    });
    while (this.data[0][0] < frame.time - WIDTH) for (const column of this.data) column.shift();
  }

  clear(): void {
    for (const column of this.data) column.length = 0;
  }

  draw(): void {
    const last = this.data[0].at(-1);
    if (last === undefined) return;
    this.plot.setData(this.data as uPlot.AlignedData, false);
    this.plot.batch(() => {
      this.plot.setScale("x", { min: last - WIDTH, max: last });
      this.plot.setScale("y", this.range());
    });
    this.values.forEach((value, k) => {
      value.textContent = fixed(this.data[k + 1].at(-1)!, this.about.digits);
    });
  }

  /** The range of all curves, and at least that of the plot, with some room above and below. */
  private range(): { min: number; max: number } {
    let [min, max] = this.about.least;
    for (const column of this.data.slice(1))
      for (const value of column) [min, max] = [Math.min(min, value), Math.max(max, value)];
    const room = 0.06 * (max - min);
    return { min: min < 0 ? min - room : min, max: max + room };
  }

  private describe(): uPlot.Options {
    const quiet = quietAxis();
    return {
      width: 100,
      height: 110,
      legend: { show: false },
      cursor: { show: false },
      padding: [6, 6, 0, 0],
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [
        { ...quiet, size: 20, space: 60 },
        { ...quiet, size: 38, space: 26 },
      ],
      series: [
        {},
        ...this.about.curves.map(({ colour }) => ({
          stroke: () => property(colour),
          width: 1.6,
          points: { show: false },
        })),
      ],
    };
  }
}
