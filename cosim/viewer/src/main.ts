import { Color } from "three";
import plotStyle from "uplot/dist/uPlot.min.css";
import { Actor } from "./actor";
import { Clock } from "./clock";
import { byId, element } from "./dom";
import { listenToKeys } from "./keyboard";
import { footCentres, poseAt } from "./kinematics";
import { drawPath } from "./overhead";
import type { Panel } from "./panel";
import { labelTimes, panelMakers, type Run } from "./panels";
import { unpack } from "./recording";
import { Span } from "./span";
import { Stage } from "./stage";
import { findStances } from "./stances";
import { property, readColours, Theme } from "./theme";
import { enlargement } from "./trails";
import { makeWindowButtons, Transport } from "./transport";
import type { Payload } from "./types";

const LONGEST_FRAME = 0.1; // s    a tab that slept does not leap
const SHOWN_CYCLES = 3;

/** What whoever asks on the console, or a test, finds as `hexapod`. */
const offered: Record<string, unknown> = {};

/** Text and tables first, then plots, then the replay, which has to wait for the graphics driver. */
async function start(): Promise<void> {
  await painted();
  const payload = JSON.parse(byId("recording")!.textContent!) as Payload;
  document.head.append(element("style", "", plotStyle));
  const theme = new Theme(byId<HTMLButtonElement>("theme"));
  const runs: Run[] = await Promise.all(
    payload.runs.map(async (run) => ({ run, recording: await unpack(run) })),
  );
  const clock = new Clock(
    Math.min(...runs.map(({ recording }) => recording.start)),
    Math.max(...runs.map(({ recording }) => recording.end)),
  );
  clock.seek(askedTime() ?? clock.start);
  const transport = new Transport(clock);
  listenToKeys(clock, { follow: () => transport.toggleFollow(), theme: () => theme.toggle() });
  const panels = await makePanels(runs, clock);
  theme.listen(() => {
    for (const panel of panels) panel.repaint();
  });
  Object.assign(offered, { clock, feet: (label: string) => feetOf(runs, label, clock) });
  Object.assign(window, { hexapod: offered });
  document.documentElement.dataset.opened = "true";
  await painted();
  await raiseCurtain(runs, clock, theme, transport);
  document.documentElement.dataset.ready = "true";
}

/** The stage, and then the walk. */
async function raiseCurtain(
  runs: readonly Run[],
  clock: Clock,
  theme: Theme,
  transport: Transport,
): Promise<void> {
  const stage = makeStage(runs);
  if (stage) {
    const repaint = () => {
      stage.paint(readColours());
      stage.show(clock.time);
    };
    theme.listen(repaint);
    await addTrails(stage);
    repaint(); // with the trails: they are made whole, showing a time cuts off what is still to come
    clock.listen(() => stage.show(clock.time));
    await stage.prepare();
    transport.attach(stage);
    offered.shown = (label: string) => stage.actors.find(({ run }) => run.label === label)?.shown();
  }
  begin(clock);
  runForever(clock, stage);
}

/** The 3D view; undefined, and a word in its place, where the browser or the recording cannot give it. */
function makeStage(runs: readonly Run[]): Stage | undefined {
  const host = byId("stage");
  const able = runs.filter(({ run, recording }) =>
    recording.has("torso.x", "torso.qw", `${run.robot.legs[0].name}.coxa.angle`),
  );
  if (!host || able.length === 0) {
    refuse(
      host,
      "The replay needs torso.position, torso.quaternion and the joints' angles, which were not recorded (outputs.csv).",
    );
    return undefined;
  }
  try {
    return new Stage(
      host,
      able.map(
        ({ run, recording }) => new Actor(run, recording, new Color(property(`--${run.label}`))),
      ),
    );
  } catch {
    refuse(
      host,
      "The replay needs WebGL, which this browser does not offer. Plots and tables do without.",
    );
    return undefined;
  }
}

function refuse(host: HTMLElement | null, text: string): void {
  host?.replaceChildren(element("p", "refusal", text));
  host?.classList.add("refused");
}

/** A time that the page's address names: #t=2.5 */
function askedTime(): number | undefined {
  const asked = /^#t=([\d.]+)$/.exec(location.hash);
  return asked ? Number(asked[1]) : undefined;
}

/** Plays at once, unless the reader asks for less motion or for a time. */
function begin(clock: Clock): void {
  if (askedTime() === undefined && !matchMedia("(prefers-reduced-motion: reduce)").matches)
    clock.play();
}

function runForever(clock: Clock, stage: Stage | undefined): void {
  let last = performance.now();
  const frame = (now: number): void => {
    clock.advance(Math.min((now - last) / 1000, LONGEST_FRAME));
    last = now;
    stage?.render();
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

async function addTrails(stage: Stage): Promise<void> {
  await rest();
  const found = stage.actors.map(({ recording, run }) =>
    findStances(recording, run.robot, run.ground),
  );
  const enlarged = enlargement(found.flat());
  stage.actors.forEach((actor, k) => {
    actor.addTrails(found[k], enlarged);
  });
  const note = byId("trail-note");
  if (note) note.textContent = enlarged > 1 ? `slip trails, ${enlarged} × as long` : "slip trails";
}

/** One plot after the other, with rests in which the replay goes on. */
async function makePanels(runs: readonly Run[], clock: Clock): Promise<Panel[]> {
  const whole = clock.end - clock.start;
  const cycles = new Span(
    clock.start,
    clock.end,
    Math.min(SHOWN_CYCLES * runs[0].run.period, whole),
  );
  const walk = new Span(clock.start, clock.end, whole);
  cycles.follow(clock.time);
  makeWindowButtons(cycles, clock, runs[0].run.period);
  const panels: Panel[] = [];
  for (const make of panelMakers(runs, clock, { cycles, walk })) {
    await rest();
    panels.push(make());
  }
  labelTimes();
  drawPath(runs, clock);
  clock.listen(() => cycles.follow(clock.time));
  return panels;
}

/** After the browser has shown the page's text and tables. */
function painted(): Promise<void> {
  return new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
}

function rest(): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve));
}

/** World positions of the feet's centres now, for whoever asks on the console. */
function feetOf(runs: readonly Run[], label: string, clock: Clock): number[][] {
  const found = runs.find(({ run }) => run.label === label);
  const pose = found && poseAt(found.recording, found.run.robot, clock.time);
  return found && pose ? footCentres(found.run.robot, pose).map((foot) => foot.toArray()) : [];
}

start().catch((error: unknown) => {
  refuse(
    byId("stage"),
    `The replay did not start: ${error instanceof Error ? error.message : String(error)}`,
  );
  throw error;
});
