import { Color } from "three";
import plotStyle from "uplot/dist/uPlot.min.css";
import { Clock } from "./clock";
import { byId, element } from "./dom";
import { footCentres, poseAt } from "./kinematics";
import { type Panel, Span } from "./panels/panel";
import { labelTimes, panelMakers, type Run } from "./panels/panels";
import { unpack } from "./recording";
import { Actor } from "./scene/actor";
import { Stage } from "./scene/stage";
import { Relief, unpackSurface } from "./scene/surface";
import { enlargement, findStancePhases } from "./scene/trails";
import { property, readColours, Theme } from "./theme";
import { listenToKeys, makeWindowButtons, Transport } from "./transport";
import type { Payload } from "./types";

const LONGEST_FRAME = 0.1; // s    limits the jump after the tab was inactive
const SHOWN_CYCLES = 3;

/** The functions available on the console and to tests as `window.hexapod`. */
const consoleFunctions: Record<string, unknown> = {};

/** Shows text and tables first, then plots, then the replay, which needs the graphics driver. */
async function open(): Promise<void> {
  await afterPaint();
  const payload = JSON.parse(byId("recording")!.textContent!) as Payload;
  document.head.append(element("style", "", plotStyle));
  const theme = new Theme(byId<HTMLButtonElement>("theme"));
  const surfaces = await Promise.all(payload.surfaces.map(unpackSurface));
  const runs: Run[] = await Promise.all(
    payload.runs.map(async (run) => ({
      run,
      recording: await unpack(run),
      relief: new Relief(run.ground, surfaces[run.ground.surface ?? -1]),
    })),
  );
  const clock = new Clock(
    Math.min(...runs.map(({ recording }) => recording.start)),
    Math.max(...runs.map(({ recording }) => recording.end)),
  );
  clock.seek(requestedTime() ?? clock.start);
  const transport = new Transport(clock);
  listenToKeys(clock, () => theme.toggle());
  const panels = await makePanels(runs, clock);
  theme.listen(() => {
    for (const panel of panels) panel.repaint();
  });
  Object.assign(consoleFunctions, {
    clock,
    feet: (label: string) => feetOf(runs, label, clock),
  });
  Object.assign(window, { hexapod: consoleFunctions });
  document.documentElement.dataset.opened = "true";
  await afterPaint();
  await startReplay(runs, clock, theme, transport);
  document.documentElement.dataset.ready = "true";
}

/** Makes the 3D view, if possible, and starts the clock. */
async function startReplay(
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
    repaint(); // after addTrails: trails are made whole, and show() hides what is still to come
    clock.listen(() => stage.show(clock.time));
    await stage.prepare();
    transport.attach(stage);
    consoleFunctions.shown = (label: string) =>
      stage.actors.find(({ run }) => run.label === label)?.shown();
  }
  playUnlessAsked(clock);
  runFrames(clock, stage);
}

/** Returns the 3D view; where browser or recording do not allow one, shows why instead. */
function makeStage(runs: readonly Run[]): Stage | undefined {
  const host = byId("stage");
  const able = runs.filter(({ run, recording }) =>
    recording.has("torso.x", "torso.qw", `${run.robot.legs[0].name}.coxa.angle`),
  );
  if (!host || able.length === 0) {
    showReason(
      host,
      "The replay needs torso.position, torso.quaternion and the joints' angles, " +
        "which were not recorded (outputs.csv).",
    );
    return undefined;
  }
  try {
    return new Stage(
      host,
      able.map(
        ({ run, recording, relief }) =>
          new Actor(run, recording, relief, new Color(property(`--${run.key}`))),
      ),
    );
  } catch {
    showReason(host, "This browser has no WebGL, which the replay needs. Plots and tables work.");
    return undefined;
  }
}

/** Shows in the place of the 3D view why there is none. */
function showReason(host: HTMLElement | null, text: string): void {
  host?.replaceChildren(element("p", "refusal", text));
  host?.classList.add("refused");
}

/** Returns the time in the page's address, as in #t=2.5 */
function requestedTime(): number | undefined {
  const found = /^#t=([\d.]+)$/.exec(location.hash);
  return found ? Number(found[1]) : undefined;
}

/** Starts playing, unless the reader prefers reduced motion or the address names a time. */
function playUnlessAsked(clock: Clock): void {
  if (requestedTime() === undefined && !matchMedia("(prefers-reduced-motion: reduce)").matches)
    clock.play();
}

/** Advances the clock and draws, once per animation frame. */
function runFrames(clock: Clock, stage: Stage | undefined): void {
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
  await nextTask();
  const found = stage.actors.map(({ recording, run, relief }) =>
    findStancePhases(recording, run.robot, relief),
  );
  const enlarged = enlargement(found.flat());
  stage.actors.forEach((actor, k) => {
    actor.addTrails(found[k], enlarged);
  });
  const note = byId("trail-note");
  if (note) note.textContent = enlarged > 1 ? `slip trails, ${enlarged} × as long` : "slip trails";
}

/** Makes one plot after the other; between them the browser can handle other tasks. */
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
    await nextTask();
    panels.push(make());
  }
  labelTimes();
  clock.listen(() => cycles.follow(clock.time));
  return panels;
}

/** Waits until the browser has painted. */
function afterPaint(): Promise<void> {
  return new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
}

/** Lets the browser handle other tasks. */
function nextTask(): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve));
}

/** Returns the present world positions of the feet's centres, for the console. */
function feetOf(runs: readonly Run[], label: string, clock: Clock): number[][] {
  const found = runs.find(({ run }) => run.label === label);
  const pose = found && poseAt(found.recording, found.run.robot, clock.time);
  return found && pose ? footCentres(found.run.robot, pose).map((foot) => foot.toArray()) : [];
}

// One bundle serves all kinds of pages, so that a wheel holds the libraries once. A report has its
// recording inside; tools/build_viewer.py adds the pages of the extensions.
if (byId("recording")) {
  open().catch((error: unknown) => {
    showReason(
      byId("stage"),
      `The replay did not start: ${error instanceof Error ? error.message : String(error)}`,
    );
    throw error;
  });
}
