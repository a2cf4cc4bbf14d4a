import { type Clock, SPEEDS } from "./clock";
import { byId, element } from "./dom";
import type { Span } from "./panels/span";
import type { Stage } from "./scene/stage";

const WINDOWS = [1, 3, 10]; // gait cycles shown by the plots

/** The bar under the 3D view: play, time, speed, follow, and reset of the camera. */
export class Transport {
  private readonly play = byId<HTMLButtonElement>("play");
  private readonly slider = byId<HTMLInputElement>("time");
  private readonly label = byId<HTMLElement>("clock");
  private readonly speed = byId<HTMLSelectElement>("speed");
  private readonly follow = byId<HTMLButtonElement>("follow");

  private stage: Stage | undefined;

  constructor(private readonly clock: Clock) {
    this.prepare();
    this.play?.addEventListener("click", () => clock.toggle());
    this.slider?.addEventListener("input", () => {
      const asked = Number(this.slider!.value); // read first, since pausing updates the slider
      clock.pause();
      clock.seek(asked);
    });
    this.speed?.addEventListener("change", () => clock.setSpeed(Number(this.speed!.value)));
    this.follow?.addEventListener("click", () => this.toggleFollow());
    byId("home")?.addEventListener("click", () => this.stage?.home());
    clock.listen(() => this.show());
    this.show();
  }

  /** Connects the bar to the stage whose camera its buttons move. */
  attach(stage: Stage): void {
    this.stage = stage;
    for (const button of [this.follow, byId<HTMLButtonElement>("home")])
      if (button) button.disabled = false;
  }

  toggleFollow(): void {
    if (!this.stage) return;
    this.stage.follows = !this.stage.follows;
    this.follow?.setAttribute("aria-pressed", String(this.stage.follows));
    this.stage.show(this.clock.time);
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
    for (const button of [this.follow, byId<HTMLButtonElement>("home")])
      if (button) button.disabled = true;
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
  const host = byId("windows");
  const whole = clock.end - clock.start;
  const cycles = WINDOWS.filter((count) => count * period < whole);
  const choices = [
    ...cycles.map((count) => ({
      text: count === 1 ? "1 cycle" : `${count} cycles`,
      width: count * period,
    })),
    { text: "whole run", width: whole },
  ];
  const buttons = choices.map(({ text, width }) => {
    const button = element("button", "choice", text);
    button.type = "button";
    button.addEventListener("click", () => span.show(clock.time - 0.5 * width, width));
    return { button, width };
  });
  const mark = () => {
    const [low, high] = span.limits;
    for (const { button, width } of buttons)
      button.setAttribute("aria-pressed", String(Math.abs(high - low - width) < 1e-6 * whole));
  };
  span.listen(mark);
  mark();
  host?.append(...buttons.map(({ button }) => button));
}
