import type { Clock } from "../clock";
import { element } from "../dom";
import type { PackedProfile } from "../types";
import { multiples, stepOf, svg } from "./overhead";
import { tick } from "./panel";
import { hostOf, type Run } from "./run";

const WIDTH = 1000;
const HEIGHT = 200;
const EDGE = 16; // margin above and below, in units of the drawing
const LEAST = 0.02; // m    of the upright axis
const TENTH = 1e-4; // m    unit of packed heights
const LARGEST = 4; // the largest factor by which heights are drawn larger than ways

/** The mapping from way and height [m] to the drawing. */
interface Frame {
  readonly ends: readonly [readonly [number, number], readonly [number, number]];
  readonly tall: number; // units of the drawing
  readonly times: number; // by which heights are enlarged
  across(way: number): number;
  up(height: number): number;
}

/**
 * Draws the ground under the torso's path of each run that walked on a surface: the line below the
 * torso, a band from the lowest to the highest ground across the robot's width, a dot where each
 * foot touched down, and the torso at the replay's time.
 */
export function drawProfiles(runs: readonly Run[], clock: Clock): void {
  const host = hostOf("profile");
  if (!host) return;
  for (const run of runs) {
    const { profile } = run.run.ground;
    if (profile && run.recording.has("way")) host.append(drawProfile(run, profile, clock));
  }
}

function drawProfile(run: Run, profile: PackedProfile, clock: Clock): HTMLElement {
  const frame = frameOf(profile);
  const drawing = svg("svg", {
    viewBox: `0 0 ${WIDTH} ${frame.tall}`,
    role: "img",
    "aria-label": `Height profile of the ground, ${run.run.label}`,
  });
  const labels = axes(drawing, frame);
  drawing.append(svg("polygon", { class: "band", points: bandOf(profile, frame) }));
  drawing.append(
    svg("polyline", { class: "soil-line", points: lineOf(profile.ground, profile, frame) }),
  );
  const dots = profile.feet.map(([, time, way, height]) => {
    const dot = svg("circle", {
      class: `touch ${run.run.key}`,
      r: "3.6",
      cx: frame.across(way).toFixed(1),
      cy: frame.up(height).toFixed(1),
    });
    return { dot, time };
  });
  const here = svg("line", { class: "here", y1: "0", y2: String(frame.tall) });
  drawing.append(...dots.map(({ dot }) => dot), here);
  const show = () => {
    const x = frame.across(run.recording.value("way", clock.time)).toFixed(1);
    here.setAttribute("x1", x);
    here.setAttribute("x2", x);
    for (const { dot, time } of dots) dot.classList.toggle("coming", time > clock.time);
  };
  clock.listen(show);
  show();
  drawing.addEventListener("pointerdown", (event) => {
    const box = drawing.getBoundingClientRect();
    clock.seek(timeAt(run, frame, ((event.clientX - box.left) / box.width) * WIDTH));
  });
  const map = element("div", "map");
  map.append(drawing, ...labels);
  const figure = element("div", "profile");
  const note = frame.times === 1 ? "To scale." : `Heights drawn ${frame.times} times larger.`;
  figure.append(
    element("p", "panel-title", run.run.label),
    map,
    element("p", "across", "way along the path [m]"),
    element("p", "note", `Height [mm] upwards. ${note}`),
  );
  return figure;
}

/** Returns a frame in which heights are to scale or enlarged by a whole number. */
function frameOf(profile: PackedProfile): Frame {
  const feet = profile.feet.map(([, , , height]) => height);
  const ways = profile.feet.map(([, , way]) => way);
  const [begin, end] = [Math.min(profile.begin, ...ways), Math.max(profile.end, ...ways)];
  const low = Math.min(TENTH * Math.min(...profile.low), ...feet);
  const high = Math.max(TENTH * Math.max(...profile.high), ...feet, low + LEAST);
  const across = WIDTH / (end - begin);
  const fitting = Math.floor((HEIGHT - 2 * EDGE) / (across * (high - low)));
  const times = Math.min(Math.max(fitting, 1), LARGEST);
  const tall = times * across * (high - low) + 2 * EDGE;
  return {
    ends: [
      [begin, end],
      [low, high],
    ],
    tall,
    times,
    across: (way) => across * (way - begin),
    up: (height) => tall - EDGE - times * across * (height - low),
  };
}

function lineOf(heights: readonly number[], profile: PackedProfile, frame: Frame): string {
  const step = (profile.end - profile.begin) / (heights.length - 1);
  return heights
    .map((height, k) => {
      const way = profile.begin + k * step;
      return `${frame.across(way).toFixed(1)},${frame.up(TENTH * height).toFixed(1)}`;
    })
    .join(" ");
}

function bandOf(profile: PackedProfile, frame: Frame): string {
  const back = lineOf(profile.low, profile, frame).split(" ").reverse().join(" ");
  return `${lineOf(profile.high, profile, frame)} ${back}`;
}

/** Draws the lines of both axes and returns their values. */
function axes(drawing: SVGElement, frame: Frame): HTMLElement[] {
  const [ways, heights] = frame.ends;
  const [low, high] = [1e3 * heights[0], 1e3 * heights[1]];
  const [stepX, stepY] = [stepOf(ways, 6), stepOf([low, high], 4)];
  const label = (text: string, name: string, place: string, share: number) => {
    const made = element("span", name, text);
    made.style.setProperty(place, `${100 * share}%`);
    return made;
  };
  const across = multiples(ways, stepX).map((way) => {
    const x = String(frame.across(way));
    drawing.append(svg("line", { class: "mesh", x1: x, x2: x, y1: "0", y2: String(frame.tall) }));
    return label(tick(way, stepX), "along", "left", frame.across(way) / WIDTH);
  });
  const upwards = multiples([low, high], stepY).map((height) => {
    const y = frame.up(1e-3 * height);
    const ends = { x1: "0", x2: String(WIDTH), y1: String(y), y2: String(y) };
    drawing.append(svg("line", { class: "mesh", ...ends }));
    return label(tick(height, stepY), "beside", "top", y / frame.tall);
  });
  return [...across, ...upwards];
}

/** Returns the time at which the torso was nearest to a place of the drawing. */
function timeAt({ recording }: Run, frame: Frame, x: number): number {
  const way = recording.column("way");
  let [best, found] = [Number.POSITIVE_INFINITY, recording.start];
  for (let row = 0; row < way.length; row++) {
    const distance = Math.abs(frame.across(way[row]) - x);
    if (distance < best) [best, found] = [distance, recording.time[row]];
  }
  return found;
}
