import { type Clock, SPEEDS } from "./clock";
import { byId, element, listenToHelp } from "./dom";
import type { Span } from "./panels/panel";
import type { Stage } from "./scene/stage";

const WINDOWS = [1, 3, 10]; // gait cycles shown by the plots

/** The bar under the 3D view: play, time, speed, and reset of the camera. */
export class Transport {
  private readonly play = byId<HTMLButtonElement>("play");
  private readonly slider = byId<HTMLInputElement>("time");
  private readonly label = byId<HTMLElement>("clock");
  private readonly speed = byId<HTMLSelectElement>("speed");
  private readonly home = byId<HTMLButtonElement>("home");

  constructor(private readonly clock: Clock) {
    this.prepare();
    this.play?.addEventListener("click", () => clock.toggle());
    this.slider?.addEventListener("input", () => {
      const asked = Number(this.slider!.value); // read first, since pausing updates the slider
      clock.pause();
      clock.seek(asked);
    });
    this.speed?.addEventListener("change", () => clock.setSpeed(Number(this.speed!.value)));
    clock.listen(() => this.show());
    this.show();
  }

  /** Connects the bar to the stage whose camera its button resets. */
  attach(stage: Stage): void {
    if (!this.home) return;
    this.home.disabled = false;
    this.home.addEventListener("click", () => stage.home());
  }

  private prepare(): void {
    if (this.slider) {
      this.slider.min = String(this.clock.start);
      this.slider.max = String(this.clock.end);
      this.slider.step = "any";
    }
    this.speed?.append(
      ...SPEEDS.map((speed) => new Option(`${speed}×`, String(speed), speed === 1, speed === 1)),
    );
    if (this.home) this.home.disabled = true;
  }

  private show(): void {
    const { time, end, playing, speed } = this.clock;
    if (this.slider) {
      this.slider.value = String(time);
      this.slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
      this.slider.style.setProperty(
        "--done",
        `${(100 * (time - this.clock.start)) / Math.max(end - this.clock.start, 1e-9)}%`,
      );
    }
    if (this.label) this.label.textContent = `${time.toFixed(2)} / ${end.toFixed(1)} s`;
    if (this.speed) this.speed.value = String(speed);
    if (this.play?.getAttribute("aria-pressed") !== String(playing)) {
      this.play?.setAttribute("aria-pressed", String(playing));
      this.play?.setAttribute("aria-label", playing ? "Pause" : "Play");
    }
  }
}

/** Makes the buttons that set how much the plots show: one cycle, three, ten or the whole run. */
export function makeWindowButtons(span: Span, clock: Clock, period: number): void {
  const whole = clock.end - clock.start;
  const cycles = WINDOWS.filter((count) => count * period < whole);
  const choices: [string, number][] = [
    ...cycles.map((count): [string, number] => [`${count} cycles`, count * period]),
    ["whole run", whole],
  ];
  for (const [text, width] of choices) {
    const button = element("button", "choice", text.replace(/^1 cycles/, "1 cycle"));
    button.type = "button";
    button.addEventListener("click", () => span.show(clock.time - 0.5 * width, width));
    const mark = () => {
      const [low, high] = span.limits;
      const shown = Math.abs(high - low - width) < 1e-6 * whole;
      button.setAttribute("aria-pressed", String(shown));
    };
    span.listen(mark);
    mark();
    byId("windows")?.append(button);
  }
}

const STEP = 0.02; // s    for an arrow key
const LEAP = 0.5; // s    for an arrow key with shift

/** Handles the keys of the replay, except keys that the focused element uses itself. */
export function listenToKeys(clock: Clock, toggleTheme: () => void): void {
  const askHelp = listenToHelp();
  const move = (seconds: number) => {
    clock.pause();
    clock.seek(clock.time + seconds);
  };
  const keys: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => clock.toggle(),
    ArrowLeft: (event) => move(event.shiftKey ? -LEAP : -STEP),
    ArrowRight: (event) => move(event.shiftKey ? LEAP : STEP),
    Home: () => clock.seek(clock.start),
    End: () => clock.seek(clock.end),
    "+": () => clock.changeSpeed(1),
    "=": () => clock.changeSpeed(1),
    "-": () => clock.changeSpeed(-1),
    t: toggleTheme,
    "?": askHelp,
  };
  document.addEventListener("keydown", (event) => {
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || ownsKey(event)) return;
    event.preventDefault();
    act(event);
  });
}

/** Whether the focused element uses the key itself. */
function ownsKey(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  if (document.querySelector("dialog[open]") && event.key !== "?") return true;
  if (target.matches("select, input:not([type=range]), textarea")) return true;
  return event.key === " " && target.matches("button, a, summary");
}
