import type uPlot from "uplot";
import type { Clock } from "../clock";
import { property } from "../theme";
import { Panel } from "./panel";
import type { Run } from "./run";
import type { Span } from "./span";

const BAND = 0.84; // height of the band of a planned swing, relative to a row
const BAR = 0.5; // height of the bar of a foot on the ground, relative to a row
const HEIGHT = 170; // px

/**
 * Returns how to make the plot of a run's footfall, or [] when contacts were not recorded.
 * Bars show which feet are on the ground, bands behind them where the gait plans a swing.
 */
export function footfallPanel(
  { run, recording }: Run,
  host: HTMLElement | null,
  clock: Clock,
  span: Span,
): (() => Panel)[] {
  const legs = run.robot.legs.map(({ name }) => name);
  if (!host || !recording.has(...legs.map((leg) => `${leg}.contact`))) return [];
  const feet = `--${run.key}`;
  const draw = (plot: uPlot): void => {
    const context = plot.ctx;
    context.save();
    context.beginPath();
    context.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
    context.clip();
    legs.forEach((leg, row) => {
      if (recording.has(`${leg}.swing`))
        bars(
          plot,
          recording.time,
          recording.column(`${leg}.swing`),
          row,
          BAND,
          property("--swing"),
        );
      bars(plot, recording.time, recording.column(`${leg}.contact`), row, BAR, property(feet));
    });
    context.restore();
  };
  const down = (time: number): number =>
    legs.filter((leg) => recording.column(`${leg}.contact`)[recording.place(time).row] > 0.5)
      .length;
  const still = new Float32Array(recording.time.length).fill(Number.NaN);
  const curve = { label: "feet down", colour: feet, time: recording.time, values: still, at: down };
  const axes = {
    stroke: () => property("--muted"),
    grid: { show: false },
    ticks: { show: false },
    font: "11px system-ui",
  };
  const more: Partial<uPlot.Options> = {
    scales: {
      x: { time: false, min: span.limits[0], max: span.limits[1] },
      y: { range: [-0.5, legs.length - 0.5], dir: -1 },
    },
    axes: [
      { ...axes, size: 22, gap: 3, space: 60 },
      {
        ...axes,
        size: 46,
        gap: 4,
        splits: () => legs.map((_, k) => k),
        values: () => legs,
        space: 1,
      },
    ],
    hooks: { draw: [draw] },
  };
  return [
    () =>
      new Panel(
        { title: run.label, unit: "", height: HEIGHT, curves: [curve], host, more },
        clock,
        span,
      ),
  ];
}

/** Draws a bar in a row for each period in which a flag is on. */
function bars(
  plot: uPlot,
  time: Float64Array,
  flag: Float32Array,
  row: number,
  share: number,
  colour: string,
): void {
  const top = plot.valToPos(row - share / 2, "y", true);
  const height = plot.valToPos(row + share / 2, "y", true) - top;
  plot.ctx.fillStyle = colour;
  let begin = -1;
  for (let k = 0; k <= flag.length; k++) {
    const up = k < flag.length && flag[k] > 0.5;
    if (up && begin < 0) begin = k;
    if (up || begin < 0) continue;
    const left = plot.valToPos(time[begin], "x", true);
    const right = plot.valToPos(time[Math.min(k, flag.length - 1)], "x", true);
    if (right >= plot.bbox.left && left <= plot.bbox.left + plot.bbox.width)
      plot.ctx.fillRect(left, top, right - left, height);
    begin = -1;
  }
}
