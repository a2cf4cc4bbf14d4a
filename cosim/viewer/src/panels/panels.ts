import type { Clock } from "../clock";
import { element } from "../dom";
import type { Recording } from "../recording";
import type { Relief } from "../scene/surface";
import type { PackedRun } from "../types";
import { type Curve, Panel, type PanelOptions, type Span } from "./panel";

/** A run of the report with its unpacked recording. */
export interface Run {
  readonly run: PackedRun;
  readonly recording: Recording;
  readonly relief: Relief;
}

/** Returns the element of the page that holds the plots of a section. */
export function hostOf(section: string): HTMLElement | null {
  return document.querySelector<HTMLElement>(`[data-panels="${section}"]`);
}

/** A plot that shows one column of all runs. */
interface ComparedPlot {
  readonly title: string;
  readonly unit: string;
  readonly column: string;
  readonly whole?: boolean;
  readonly height?: number;
  readonly limits?: readonly [number, number] | undefined;
}

export interface Spans {
  readonly cycles: Span;
  readonly walk: Span;
}

const SIDES: Record<string, string> = { L: "left", R: "right" };
const ENDS: Record<string, string> = { F: "front", M: "middle", R: "rear" };
/**
 * Returns how to make each plot of the page, section by section. Plots whose columns were not
 * recorded are left out.
 */
export function panelMakers(runs: readonly Run[], clock: Clock, spans: Spans): (() => Panel)[] {
  const { robot } = runs[0].run;
  const legs = robot.legs.map(({ name }) => name);
  const [loads, slips, errors] = ["load", "slip", "off"].map((kind) =>
    limitsOf(
      runs,
      legs.map((leg) => `${leg}.${kind}`),
    ),
  );
  const compared: Record<string, ComparedPlot[]> = {
    foot_forces: legs.map((leg) => ({
      title: nameOf(leg),
      unit: "BW",
      column: `${leg}.load`,
      limits: loads,
    })),
    slip: [
      { title: "slipped way, all feet", unit: "mm", column: "slip.way", whole: true, height: 150 },
      ...legs.map((leg) => ({
        title: nameOf(leg),
        unit: "mm/s",
        column: `${leg}.slip`,
        limits: slips,
      })),
    ],
    feet: legs.map((leg) => ({
      title: nameOf(leg),
      unit: "mm",
      column: `${leg}.off`,
      limits: errors,
    })),
    posture: [
      { title: "height", unit: "mm", column: "height" },
      ...["roll", "pitch", "yaw"].map((name) => ({ title: name, unit: "deg", column: name })),
    ],
    torques: robot.joints.map((joint) => ({
      title: joint,
      unit: "N m",
      column: `${joint}.torque`,
    })),
  };
  return Object.entries(compared).flatMap(([section, plots]) =>
    plots.flatMap((plot) =>
      comparedPanel(section, plot, runs, clock, plot.whole ? spans.walk : spans.cycles),
    ),
  );
}

function comparedPanel(
  section: string,
  item: ComparedPlot,
  runs: readonly Run[],
  clock: Clock,
  span: Span,
): (() => Panel)[] {
  const host = hostOf(section);
  const curves = runs
    .filter(({ recording }) => recording.has(item.column))
    .map((run) => curveOf(run, item.column));
  if (!host || curves.length === 0) return [];
  const options: PanelOptions = {
    title: item.title,
    unit: item.unit,
    height: item.height ?? 130,
    curves,
    host,
    limits: item.limits,
  };
  return [() => new Panel(options, clock, span)];
}

function curveOf({ run, recording }: Run, column: string): Curve {
  return {
    label: run.label,
    colour: `--${run.key}`,
    time: recording.time,
    values: recording.column(column),
    at: (time) => recording.value(column, time),
    ...(run.dash.length > 0 ? { dash: run.dash } : {}),
  };
}

/** Returns the least and largest value of those columns that were recorded. */
function limitsOf(runs: readonly Run[], names: readonly string[]): [number, number] | undefined {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const { recording } of runs) {
    for (const name of names.filter((one) => recording.has(one))) {
      for (const value of recording.column(name))
        [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
  }
  return low <= high ? [low, high] : undefined;
}

/** Returns a leg's short name and its meaning, as "LF left front". */
function nameOf(leg: string): string {
  const [side, end] = [SIDES[leg[0]], ENDS[leg[1]]];
  return leg.length === 2 && side && end ? `${leg} ${side} ${end}` : leg;
}

/** Labels the time axis once below each group of plots. */
export function labelTimes(): void {
  for (const host of document.querySelectorAll<HTMLElement>("[data-panels]")) {
    if (host.querySelector(".playhead")) host.append(element("p", "across", "time [s]"));
  }
}
