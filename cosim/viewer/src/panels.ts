import type { Clock } from "./clock";
import { footfallPanel } from "./footfall";
import { type Curve, Panel, type PanelOptions } from "./panel";
import type { Recording } from "./recording";
import type { Span } from "./span";
import type { PackedRun } from "./types";

export interface Run {
  readonly run: PackedRun;
  readonly recording: Recording;
}

interface Wanted {
  readonly title: string;
  readonly unit: string;
  readonly column: string;
  readonly whole?: boolean;
  readonly height?: number;
}

export interface Spans {
  readonly cycles: Span;
  readonly walk: Span;
}

const DASH = [6, 3];
const BOOKS = [
  ["actuator_work", "work of motors", "--c1"],
  ["dissipated", "dissipated", "--c2"],
  ["potential", "potential", "--c3"],
  ["kinetic", "kinetic", "--c4"],
  ["push_work", "work of pushes", "--c5"],
] as const;

/** How to make each plot of the page, by the section it belongs to; those whose columns were not recorded are left out. */
export function panelMakers(runs: readonly Run[], clock: Clock, spans: Spans): (() => Panel)[] {
  const { robot } = runs[0].run;
  const legs = robot.legs.map(({ name }) => name);
  const compared: Record<string, Wanted[]> = {
    foot_forces: legs.map((leg) => ({ title: leg, unit: "BW", column: `${leg}.load` })),
    slip: [
      { title: "slipped way, all feet", unit: "mm", column: "slip.way", whole: true, height: 150 },
      ...legs.map((leg) => ({ title: leg, unit: "mm/s", column: `${leg}.slip` })),
    ],
    posture: [
      { title: "height", unit: "mm", column: "height" },
      ...["roll", "pitch", "yaw"].map((name) => ({ title: name, unit: "deg", column: name })),
    ],
    torques: robot.joints.map((joint) => ({ title: joint, unit: "N m", column: `${joint}.torque` })),
  };
  const makers = Object.entries(compared).flatMap(([section, wanted]) =>
    wanted.flatMap((item) => comparedPanel(section, item, runs, clock, item.whole ? spans.walk : spans.cycles)),
  );
  makers.push(...runs.flatMap((run) => energyPanels(run, clock, spans.walk)));
  makers.push(...runs.flatMap((run) => footfallPanel(run, hostOf("footfall"), clock, spans.cycles)));
  return makers;
}

function comparedPanel(section: string, item: Wanted, runs: readonly Run[], clock: Clock, span: Span): (() => Panel)[] {
  const host = hostOf(section);
  const curves = runs.filter(({ recording }) => recording.has(item.column)).map((run) => curveOf(run, item.column));
  if (!host || curves.length === 0) return [];
  const options: PanelOptions = { title: item.title, unit: item.unit, height: item.height ?? 130, curves, host };
  return [() => new Panel(options, clock, span)];
}

function energyPanels({ run, recording }: Run, clock: Clock, span: Span): (() => Panel)[] {
  const host = hostOf("energy");
  const books = BOOKS.filter(([name]) => recording.has(`energy.${name}`) && moves(recording.column(`energy.${name}`)));
  if (!host || books.length === 0) return [];
  const curves = books.map(([name, label, colour]) => columnCurve(recording, `energy.${name}`, label, colour));
  const residual = [columnCurve(recording, "energy.residual", "residual", "--ink")];
  return [
    () => new Panel({ title: run.label, unit: "J", height: 190, curves, host }, clock, span),
    () => new Panel({ title: `${run.label}: unexplained`, unit: "mJ", height: 190, curves: residual, host }, clock, span),
  ];
}

function curveOf({ run, recording }: Run, column: string): Curve {
  const curve = columnCurve(recording, column, run.label, `--${run.label}`);
  return run.label === "kinematic" ? { ...curve, dash: DASH } : curve;
}

function columnCurve(recording: Recording, column: string, label: string, colour: string): Curve {
  return { label, colour, time: recording.time, values: recording.column(column), at: (time) => recording.value(column, time) };
}

function moves(values: Float32Array): boolean {
  return values.some((value) => value !== values[0]);
}

export function hostOf(section: string): HTMLElement | null {
  return document.querySelector<HTMLElement>(`[data-panels="${section}"]`);
}
