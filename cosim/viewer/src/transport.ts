import { type Clock, SPEEDS } from "./clock";
import { byId, element } from "./dom";
import type { Span } from "./panels/span";
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
