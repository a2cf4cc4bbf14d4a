import type { Clock } from "../clock";
import { element } from "../dom";
import { tick } from "./panel";
import { hostOf, type Run } from "./run";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 1000;
const HEIGHT = 250;
const EDGE = 14; // margin, in units of the drawing
const MOST_POINTS = 1500; // of a path
const STRAIGHT = 0.05; // a commanded path no wider than this share of its length is drawn enlarged
const LEAST = 0.002; // m    of the sideways axis: a smaller one would show round-off as a drift

/** A path seen from above [m]. */
interface Way {
  readonly key: string;
  readonly x: Float32Array;
  readonly y: Float32Array;
  readonly time: Float64Array;
}

/**
 * Draws the torso's path from above, with a dot at the replay's time. Pressing a point moves the
 * replay to the time at which the robot was nearest.
 */
export function drawPath(runs: readonly Run[], clock: Clock): void {
  const host = hostOf("path");
  const ways = runs
    .filter(({ recording }) => recording.has("torso.x", "torso.y"))
    .map(({ run, recording }) => wayOf(run.key, recording, "torso"));
  if (!host || ways.length === 0) return;
  const first = runs[0].recording;
  const planned = first.has("command.x", "command.y") ? [wayOf("commanded", first, "command")] : [];
  const frame = frameOf([...ways, ...planned], planned[0]);
  const drawing = svg("svg", {
    viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
    role: "img",
    "aria-label": "Path of the torso from above",
  });
  for (const way of [...planned, ...ways])
    drawing.append(svg("polyline", { class: `way ${way.key}`, points: pointsOf(way, frame) }));
  const dots = ways.map((way) => svg("circle", { class: `dot ${way.key}`, r: "7" }));
  drawing.append(...dots);
  const map = element("div", "map");
  map.append(drawing, ...axes(drawing, frame));
  host.append(
    map,
    element("p", "across", "x [m]"),
    element("p", "note", `y [mm] upwards. ${frame.note}`),
  );
  const show = () => {
    ways.forEach((way, k) => {
      const row = nearestRow(way.time, clock.time);
      dots[k].setAttribute("cx", String(frame.across(way.x[row])));
      dots[k].setAttribute("cy", String(frame.up(way.y[row])));
    });
  };
  clock.listen(show);
  show();
  drawing.addEventListener("pointerdown", (event) =>
    clock.seek(timeNear(ways, frame, inside(drawing, event))),
  );
}

/**
 * Returns the values of both axes, and draws their lines. The values are elements beside the
 * drawing, so that they keep the size of text.
 */
function axes(drawing: SVGElement, frame: Frame): HTMLElement[] {
  const label = (text: string, name: string, place: string, share: number) => {
    const made = element("span", name, text);
    made.style.setProperty(place, `${100 * share}%`);
    return made;
  };
  const line = (x1: number, y1: number, x2: number, y2: number) =>
    drawing.prepend(
      svg("line", {
        class: "mesh",
        x1: String(x1),
        y1: String(y1),
        x2: String(x2),
        y2: String(y2),
      }),
    );
  const [stepX, stepY] = [
    stepOf(frame.ends[0], 6),
    stepOf(frame.ends[1].map((y) => 1e3 * y) as [number, number], 4),
  ];
  const across = multiples(frame.ends[0], stepX).map((x) => {
    line(frame.across(x), 0, frame.across(x), HEIGHT);
    return label(tick(x, stepX), "along", "left", frame.across(x) / WIDTH);
  });
  const upwards = multiples(frame.ends[1].map((y) => 1e3 * y) as [number, number], stepY).map(
    (y) => {
      line(0, frame.up(1e-3 * y), WIDTH, frame.up(1e-3 * y));
      return label(tick(y, stepY), "beside", "top", frame.up(1e-3 * y) / HEIGHT);
    },
  );
  return [...across, ...upwards];
}

/** Returns 1, 2 or 5 times a power of ten, such that about as many steps as wished fit. */
export function stepOf([low, high]: readonly [number, number], wished: number): number {
  const power = 10 ** Math.floor(Math.log10((high - low) / wished));
  return power * ([1, 2, 5].find((times) => (high - low) / (times * power) <= wished) ?? 10);
}

export function multiples([low, high]: readonly [number, number], step: number): number[] {
  const first = Math.ceil(low / step);
  return Array.from(
    { length: Math.max(Math.floor(high / step) - first + 1, 0) },
    (_, k) => (first + k) * step,
  );
}

/** The mapping from positions [m] to the drawing. */
interface Frame {
  /** Limits of x and of y in the drawing [m]. */
  readonly ends: readonly [readonly [number, number], readonly [number, number]];
  across(x: number): number;
  up(y: number): number;
  readonly note: string;
}

function wayOf(key: string, recording: Run["recording"], stem: string): Way {
  return {
    key,
    x: recording.column(`${stem}.x`),
    y: recording.column(`${stem}.y`),
    time: recording.time,
  };
}

/**
 * Returns a frame to scale for a curved path. For a straight one the sideways axis is enlarged, and
 * the note tells by how much.
 */
function frameOf(ways: readonly Way[], planned: Way | undefined): Frame {
  const [left, right] = limits(ways.map((way) => way.x));
  const [low, high] = limits(ways.map((way) => way.y));
  const length = Math.max(right - left, LEAST);
  const across = (WIDTH - 2 * EDGE) / length;
  const bends = planned ? spread(planned.y) > STRAIGHT * spread(planned.x) : true;
  const tall = (HEIGHT - 2 * EDGE) / Math.max(high - low, LEAST);
  const scales = bends ? [Math.min(across, tall), Math.min(across, tall)] : [across, tall];
  const [middle, level] = [0.5 * (left + right), 0.5 * (low + high)];
  const size = `${length.toFixed(2)} m from left to right`;
  const height = Number((1e3 * Math.max(high - low, LEAST)).toPrecision(2)); // no power of ten
  const times = Math.round(scales[1] / scales[0]);
  const note = bends
    ? `To scale, ${size}.`
    : `${size}, ${height} mm from top to bottom: sideways drawn ${times} times larger.`;
  const half = [(0.5 * WIDTH) / scales[0], (0.5 * HEIGHT) / scales[1]];
  const ends = [
    [middle - half[0], middle + half[0]] as const,
    [level - half[1], level + half[1]] as const,
  ] as const;
  return {
    ends,
    across: (x) => 0.5 * WIDTH + scales[0] * (x - middle),
    up: (y) => 0.5 * HEIGHT - scales[1] * (y - level),
    note,
  };
}

function limits(columns: readonly Float32Array[]): [number, number] {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const column of columns)
    for (const value of column) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return [low, high];
}

function spread(column: Float32Array): number {
  const [low, high] = limits([column]);
  return high - low;
}

function pointsOf(way: Way, frame: Frame): string {
  const step = Math.max(1, Math.ceil(way.x.length / MOST_POINTS));
  const rows = Array.from({ length: Math.ceil(way.x.length / step) }, (_, k) => k * step);
  return rows
    .map((row) => `${frame.across(way.x[row]).toFixed(1)},${frame.up(way.y[row]).toFixed(1)}`)
    .join(" ");
}

function nearestRow(time: Float64Array, wanted: number): number {
  let [low, high] = [0, time.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

function timeNear(ways: readonly Way[], frame: Frame, [x, y]: readonly [number, number]): number {
  let [best, found] = [Number.POSITIVE_INFINITY, 0];
  for (const way of ways) {
    for (let row = 0; row < way.x.length; row++) {
      const distance = Math.hypot(frame.across(way.x[row]) - x, frame.up(way.y[row]) - y);
      if (distance < best) [best, found] = [distance, way.time[row]];
    }
  }
  return found;
}

function inside(drawing: SVGElement, event: PointerEvent): [number, number] {
  const box = drawing.getBoundingClientRect();
  return [
    ((event.clientX - box.left) / box.width) * WIDTH,
    ((event.clientY - box.top) / box.height) * HEIGHT,
  ];
}

export function svg(tag: string, attributes: Record<string, string>): SVGElement {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}
