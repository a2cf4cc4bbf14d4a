import { byId, element } from "../dom";
import type { Drive } from "./drive";
import type { Connection, State } from "./link";
import type { Frame, Settings, Setup, Status } from "./messages";

const SHOWN = 7000; // ms    that a note stays
const SPAN = 0.33; // s    time constant of the speeds' means
const SLOW = 0.98; // real-time factor below which it is marked
const STATES: Record<State, string> = {
  connecting: "connecting",
  open: "live",
  silent: "the loop does not answer",
  lost: "no connection: is hexapod live still running?",
  refused: "the connection was refused",
};

/** The page's buttons, choices and figures. */
export class Panel {
  private settings: Settings | undefined;
  private status: Status | undefined;
  private noted = 0;
  private pages = 1;
  private forward = 0; // m/s    mean of the last time
  private turn = 0; // rad/s
  private time = 0; // s    of the last frame

  constructor(
    private readonly setup: Setup,
    private readonly link: Connection,
    private readonly drive: Drive,
  ) {
    this.makeChoices();
    this.listenToSliders();
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-do]"))
      button.addEventListener("click", () => this.act(button.dataset.do!));
    link.on("status", (status) => this.show(status));
    link.on("pages", ({ count }) => {
      this.pages = count;
    });
    link.on("refused", ({ reason }) => note(reason));
    link.watchState((state) => this.showState(state));
    drive.listen(() => this.showDrive());
    this.showDrive();
  }

  /** Asks for another value of a setting. */
  change(key: keyof Settings, value: string | number): void {
    this.link.send({ type: "set", key, value });
  }

  /** Goes to the next value of a setting, or with -1 to the one before. */
  next(key: "gait" | "control", step = 1): void {
    const names = key === "gait" ? this.setup.gaits : this.setup.controls.map(({ name }) => name);
    const present = names.indexOf((this.status?.wanted ?? this.settings)?.[key] ?? "");
    this.change(key, names[(present + step + names.length) % names.length]);
  }

  act(action: string): void {
    const { status } = this;
    if (action === "record" && status?.mode === "recording") action = "stop";
    if (action === "replay" && status?.mode === "replaying") action = "stop";
    if (action === "pause" && status?.paused) action = "resume";
    this.link.send({ type: "do", action });
  }

  /** Shows the figures of a frame. */
  showFrame(frame: Frame): void {
    const factor = byId("factor");
    if (factor) {
      text("factor", `${frame.factor.toFixed(2)} ×`);
      factor.parentElement?.classList.toggle("bad", frame.factor < SLOW && frame.steps > 400);
    }
    text("misses", String(frame.misses));
    const share = frame.steps ? (100 * frame.misses) / frame.steps : 0;
    title(
      "misses",
      `${frame.misses} of ${frame.steps} macro-steps ended late (${share.toFixed(2)} %), ` +
        `the worst by ${(1e3 * frame.worst).toFixed(1)} ms; ` +
        `${frame.gaps} gaps, ${frame.skipped.toFixed(1)} s skipped`,
    );
    byId("gaps")?.toggleAttribute("hidden", frame.gaps === 0);
    text("skipped", `${frame.skipped.toFixed(1)} s`);
    const { latency } = this.link;
    text("latency", latency === undefined ? "–" : `${latency.toFixed(0)} ms`);
    text("seconds", `${frame.seconds.toFixed(1)} s`);
    // frames may be far apart on a slow computer
    const weight = 1 - Math.exp(-Math.max(frame.time - this.time, 0) / SPAN);
    this.time = frame.time;
    this.forward += weight * (frame.speed[0] - this.forward);
    this.turn += weight * (frame.speed[2] - this.turn);
    text("speed-now", `${whole(1e3 * this.forward)} mm/s`);
    text("turn-now", `${whole((180 / Math.PI) * this.turn)} °/s`);
    const others = this.pages > 1;
    byId("driver")?.toggleAttribute("hidden", !others);
    if (others)
      text(
        "driver",
        frame.driver === 0
          ? `${this.pages} pages`
          : frame.driver === this.link.client
            ? `${this.pages} pages, you drive`
            : `${this.pages} pages, page ${frame.driver} drives`,
      );
  }

  private makeChoices(): void {
    const make = (id: string, key: "gait" | "control", names: readonly string[]) => {
      for (const name of names) {
        const button = element("button", "", name);
        button.type = "button";
        button.dataset.value = name;
        button.addEventListener("click", () => this.change(key, name));
        byId(id)?.append(button);
      }
    };
    make("gaits", "gait", this.setup.gaits);
    make(
      "controls",
      "control",
      this.setup.controls.map(({ name }) => name),
    );
    for (const [name, reason] of Object.entries(this.setup.refused)) {
      const button = element("button", "", name);
      button.disabled = true;
      button.title = reason;
      byId("controls")?.append(button);
    }
    const grounds = byId<HTMLSelectElement>("ground");
    for (const { name, about } of this.setup.grounds) {
      const shown = name === "scenario" ? about : name.replaceAll("_", " ");
      const option = element("option", "", shown);
      option.value = name;
      option.title = about;
      grounds?.append(option);
    }
    grounds?.addEventListener("change", () => this.change("ground", grounds.value));
  }

  private listenToSliders(): void {
    const speed = byId<HTMLInputElement>("speed");
    speed?.addEventListener("input", () => {
      this.drive.speed = speed.valueAsNumber / 100;
    });
    const height = byId<HTMLInputElement>("height");
    height?.addEventListener("input", () => {
      this.drive.height = height.valueAsNumber / 100;
    });
    const friction = byId<HTMLInputElement>("friction");
    friction?.addEventListener("input", () => text("friction-value", friction.value));
    friction?.addEventListener("change", () => this.change("friction", friction.valueAsNumber));
  }

  private show(status: Status): void {
    this.status = status;
    this.settings = status.settings;
    const { settings, wanted, mode } = status;
    for (const [id, key] of [
      ["gaits", "gait"],
      ["controls", "control"],
    ] as const)
      for (const button of byId(id)?.querySelectorAll<HTMLElement>("[data-value]") ?? []) {
        button.setAttribute("aria-pressed", String(button.dataset.value === settings[key]));
        const coming = wanted !== null && wanted[key] !== settings[key];
        button.classList.toggle("coming", coming && button.dataset.value === wanted?.[key]);
      }
    const ground = byId<HTMLSelectElement>("ground");
    if (ground) ground.value = settings.ground;
    const friction = byId<HTMLInputElement>("friction");
    if (friction && document.activeElement !== friction) friction.value = String(settings.friction);
    text("friction-value", settings.friction.toFixed(2));
    this.showButtons(status);
    const fault = byId("fault");
    fault?.toggleAttribute("hidden", status.fault === "");
    text("fault-text", status.fault);
    text(
      "fault-title",
      status.stopped
        ? "The plant has stopped. Place the robot anew."
        : "The controller has failed: the joints hold. Choose a control, or place the robot anew.",
    );
    document.documentElement.dataset.mode = status.paused ? "paused" : mode;
    this.showDrive();
    for (const [number, sentence] of status.notes) if (number > this.noted) note(sentence);
    this.noted = Math.max(this.noted, ...status.notes.map(([number]) => number));
  }

  private showButtons({ mode, recorded, paused }: Status): void {
    const label = (action: string, name: string, pressed: boolean) => {
      const button = document.querySelector<HTMLElement>(`[data-do="${action}"]`);
      button?.setAttribute("aria-pressed", String(pressed));
      const place = button?.querySelector("span");
      if (place) place.textContent = name;
    };
    label("record", mode === "recording" ? "Stop" : "Record", mode === "recording");
    label("replay", mode === "replaying" ? "Stop" : "Replay", mode === "replaying");
    label("pause", paused ? "Go on" : "Pause", paused);
    const replay = document.querySelector<HTMLButtonElement>('[data-do="replay"]');
    if (replay) replay.disabled = !recorded;
    byId("save")?.classList.toggle("disabled", !recorded);
  }

  private showState(state: State): void {
    document.documentElement.dataset.link = state;
    text("state", STATES[state]);
  }

  private showDrive(): void {
    const limits = this.status?.limits;
    const speed = byId<HTMLInputElement>("speed");
    if (speed) speed.value = String(Math.round(100 * this.drive.speed));
    if (speed) fill(speed);
    const height = byId<HTMLInputElement>("height");
    if (height) height.value = String(Math.round(100 * this.drive.height));
    if (limits) {
      text("speed-value", `${(1e3 * this.drive.speed * limits.vx).toFixed(0)} mm/s`);
      const rise = this.drive.height * (this.drive.height > 0 ? limits.up : limits.down);
      text("height-value", `${rise > 0 ? "+" : ""}${(1e3 * rise).toFixed(0)} mm`);
    }
    const friction = byId<HTMLInputElement>("friction");
    if (friction) fill(friction);
  }
}

/** Shows a sentence for a while. */
export function note(sentence: string): void {
  const host = byId("notes");
  if (!host) return;
  const shown = element("p", "", sentence);
  host.append(shown);
  while (host.childElementCount > 3) host.firstElementChild?.remove();
  setTimeout(() => shown.remove(), SHOWN);
}

/** Returns a whole number without the sign of zero. */
function whole(value: number): string {
  return String(Math.round(value) + 0);
}

function text(id: string, content: string): void {
  const found = byId(id);
  if (found && found.textContent !== content) found.textContent = content;
}

function title(id: string, content: string): void {
  const found = byId(id)?.parentElement;
  if (found) found.title = content;
}

/** Colours a slider up to its value. */
function fill(slider: HTMLInputElement): void {
  const [low, high] = [Number(slider.min), Number(slider.max)];
  const share = (slider.valueAsNumber - low) / (high - low);
  slider.style.setProperty("--done", `${100 * share}%`);
}
