import type { Clock } from "./clock";
import { element } from "./dom";
import { hostOf, type Run } from "./panels";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 1000;
const HEIGHT = 250;
const EDGE = 14; // of the drawing's units
const MOST_POINTS = 1500;
const STRAIGHT = 0.05; // a commanded path no wider than this share of its length shows its drift enlarged
const LEAST = 0.002; // m    of the sideways axis: less would show round-off as a drift

interface Way {
  readonly label: string;
  readonly x: Float32Array;
  readonly y: Float32Array;
  readonly time: Float64Array;
}

/** The torso's way from above with a dot at the replay's time; pressing a place moves the replay to when the robot was nearest. */
export function drawPath(runs: readonly Run[], clock: Clock): void {
  const host = hostOf("path");
  const ways = runs
    .filter(({ recording }) => recording.has("torso.x", "torso.y"))
    .map(({ run, recording }) => wayOf(run.label, recording, "torso"));
  if (!host || ways.length === 0) return;
  const first = runs[0].recording;
  const planned = first.has("command.x", "command.y") ? [wayOf("commanded", first, "command")] : [];
  const frame = frameOf([...ways, ...planned], planned[0]);
  const drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "Path of the torso from above" });
  for (const way of [...planned, ...ways]) drawing.append(svg("polyline", { class: `way ${way.label}`, points: pointsOf(way, frame) }));
  const dots = ways.map((way) => svg("circle", { class: `dot ${way.label}`, r: "7" }));
  drawing.append(...dots);
  host.append(drawing, element("p", "note", frame.note));
  const show = () => {
    ways.forEach((way, k) => {
      const row = nearestRow(way.time, clock.time);
      dots[k].setAttribute("cx", String(frame.across(way.x[row])));
      dots[k].setAttribute("cy", String(frame.up(way.y[row])));
    });
  };
  clock.listen(show);
  show();
  drawing.addEventListener("pointerdown", (event) => clock.seek(timeNear(ways, frame, inside(drawing, event))));
}

interface Frame {
  across(x: number): number;
  up(y: number): number;
  readonly note: string;
}

function wayOf(label: string, recording: Run["recording"], stem: string): Way {
  return { label, x: recording.column(`${stem}.x`), y: recording.column(`${stem}.y`), time: recording.time };
}

/** To scale for a path that bends; for a straight one the sideways axis is enlarged, and the note says by how much. */
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
  const note = bends
    ? `To scale, ${size}.`
    : `${size}, ${(1e3 * Math.max(high - low, LEAST)).toPrecision(2)} mm from top to bottom: sideways drawn ${Math.round(scales[1] / scales[0])} times larger.`;
  return { across: (x) => 0.5 * WIDTH + scales[0] * (x - middle), up: (y) => 0.5 * HEIGHT - scales[1] * (y - level), note };
}

function limits(columns: readonly Float32Array[]): [number, number] {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const column of columns) for (const value of column) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return [low, high];
}

function spread(column: Float32Array): number {
  const [low, high] = limits([column]);
  return high - low;
}

function pointsOf(way: Way, frame: Frame): string {
  const step = Math.max(1, Math.ceil(way.x.length / MOST_POINTS));
  const rows = Array.from({ length: Math.ceil(way.x.length / step) }, (_, k) => k * step);
  return rows.map((row) => `${frame.across(way.x[row]).toFixed(1)},${frame.up(way.y[row]).toFixed(1)}`).join(" ");
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
  return [((event.clientX - box.left) / box.width) * WIDTH, ((event.clientY - box.top) / box.height) * HEIGHT];
}

function svg(tag: string, attributes: Record<string, string>): SVGElement {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}
