import { byId, element, fixed } from "../../../cosim/viewer/src/dom";
import { bodyCommand, type Drive } from "./drive";
import type { Connection, State } from "./link";
import {
  type Frame,
  footForces,
  type Lateness,
  type Settings,
  type Setup,
  type Status,
  speedOf,
} from "./messages";

const SHOWN = 7000; // ms    that a note stays
const SPAN = 0.33; // s    time constant of the speeds' means
const SLOW = 0.98; // real-time factor below which the computer is too slow
const STATES: Record<State, string> = {
  connecting: "connecting",
  open: "live",
  silent: "the loop does not answer",
  lost: "no connection: is hexapod live still running?",
  refused: "the connection was refused",
};
/** Groups of buttons of which one is chosen, and their settings. */
const GROUPS = { gaits: "gait", controls: "control" } as const;

/** The page's buttons, choices and figures. */
export class Panel {
  private status: Status | undefined;
  private forward = 0; // m/s    mean of the last time
  private turn = 0; // rad/s
  private slip = 0; // m/s
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
    link.on("note", (message) => note(message.text));
    link.watchState((state) => {
      document.documentElement.dataset.link = state;
      text("state", STATES[state]);
    });
    drive.listen(() => this.showDrive());
    this.showDrive();
  }

  /** Asks for another value of a setting. */
  change(key: keyof Settings, value: string | number): void {
    this.link.send({ type: "set", key, value });
  }

  /** Goes to the next value of a setting, or with -1 to the one before. */
  next(key: "gait" | "control", step = 1): void {
    const names = key === "gait" ? this.setup.gaits : this.setup.controls;
    const present = names.indexOf(this.status?.wanted[key] ?? "");
    this.change(key, names[(present + step + names.length) % names.length]);
  }

  act(action: string): void {
    if (action === "record" && this.status?.recording) action = "stop";
    if (action === "pause" && this.status?.paused) action = "resume";
    this.link.send({ type: "do", action });
  }

  /** Shows the figures of a frame. */
  showFrame(frame: Frame): void {
    if (frame.late) this.showLateness(frame.late);
    text("seconds", `${frame.time.toFixed(1)} s`);
    // frames may be far apart on a slow computer
    const weight = 1 - Math.exp(-Math.max(frame.time - this.time, 0) / SPAN);
    this.time = frame.time;
    const [forward, , turn] = speedOf(frame);
    this.forward += weight * (forward - this.forward);
    this.turn += weight * (turn - this.turn);
    // of the fastest foot on the ground
    const slips = footForces(frame).map(([, , up], leg) => (up > 0 ? frame.slip[leg] : 0));
    this.slip += weight * (Math.max(...slips) - this.slip);
    text("speed-now", `${fixed(1e3 * this.forward, 0)} mm/s`);
    text("turn-now", `${fixed((180 / Math.PI) * this.turn, 0)} °/s`);
    text("slip-now", `${fixed(1e3 * this.slip, 0)} mm/s`);
  }

  private showLateness({ factor, skipped }: Lateness): void {
    const slow = factor > 0 && factor < SLOW;
    text("factor", slow ? `${factor.toFixed(2)} × real time` : "in real time");
    byId("factor")?.parentElement?.classList.toggle("bad", slow);
    byId("gaps")?.toggleAttribute("hidden", skipped === 0);
    text("skipped", `${skipped.toFixed(1)} s`);
  }

  private makeChoices(): void {
    for (const [id, key] of Object.entries(GROUPS))
      for (const name of this.setup[id as keyof typeof GROUPS])
        addButton(id, name).addEventListener("click", () => this.change(key, name));
    for (const [name, reason] of Object.entries(this.setup.refused))
      Object.assign(addButton("controls", name), { disabled: true, title: reason });
    const grounds = byId<HTMLSelectElement>("ground");
    for (const { name, about } of this.setup.grounds) {
      const option = new Option(name === "scenario" ? about : name.replaceAll("_", " "), name);
      option.title = about;
      grounds?.append(option);
    }
    grounds?.addEventListener("change", () => this.change("ground", grounds.value));
  }

  private listenToSliders(): void {
    for (const name of ["speed", "height"] as const)
      byId(name)?.addEventListener("input", (event) => {
        this.drive[name] = (event.target as HTMLInputElement).valueAsNumber / 100;
      });
    const friction = byId<HTMLInputElement>("friction");
    friction?.addEventListener("input", () => text("friction-value", friction.value));
    friction?.addEventListener("change", () => this.change("friction", friction.valueAsNumber));
  }

  private show(status: Status): void {
    this.status = status;
    const { settings, wanted, recording, paused } = status;
    for (const [id, key] of Object.entries(GROUPS))
      for (const button of byId(id)?.querySelectorAll<HTMLElement>("[data-value]") ?? []) {
        const { value } = button.dataset;
        button.setAttribute("aria-pressed", String(value === settings[key]));
        button.classList.toggle("coming", value === wanted[key] && value !== settings[key]);
      }
    text("control-about", this.setup.abouts[settings.control] ?? "your own controller");
    const ground = byId<HTMLSelectElement>("ground");
    if (ground) ground.value = settings.ground;
    const friction = byId<HTMLInputElement>("friction");
    if (friction && document.activeElement !== friction) friction.value = String(settings.friction);
    text("friction-value", settings.friction.toFixed(2));
    label("record", recording ? "Stop" : "Record", recording);
    label("pause", paused ? "Go on" : "Pause", paused);
    byId("save")?.classList.toggle("disabled", !status.recorded);
    byId("fault")?.toggleAttribute("hidden", status.fault === "");
    text("fault-text", status.fault);
    text(
      "fault-title",
      status.stopped
        ? "The plant has stopped. Place the robot anew."
        : "The controller has failed: the joints hold. Choose a control, or place the robot anew.",
    );
    document.documentElement.dataset.mode = paused ? "paused" : recording ? "recording" : "free";
    this.showDrive();
  }

  private showDrive(): void {
    const { speed, height } = this.drive;
    setSlider("speed", 100 * speed);
    setSlider("height", 100 * height);
    setSlider("friction");
    const limits = this.status?.limits;
    if (!limits) return;
    const ahead = { forward: 1, left: 0, turn: 0, height, speed };
    const [forward, , , rise] = bodyCommand(ahead, limits);
    text("speed-value", `${(1e3 * forward).toFixed(0)} mm/s`);
    text("height-value", `${rise > 0 ? "+" : ""}${(1e3 * rise).toFixed(0)} mm`);
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

/** Adds a button of a choice to a group and returns it. */
function addButton(group: string, name: string): HTMLButtonElement {
  const button = element("button", "", name);
  button.type = "button";
  button.dataset.value = name;
  byId(group)?.append(button);
  return button;
}

/** Names the button of an action. */
function label(action: string, name: string, pressed: boolean): void {
  const button = document.querySelector<HTMLElement>(`[data-do="${action}"]`);
  button?.setAttribute("aria-pressed", String(pressed));
  const place = button?.querySelector("span");
  if (place) place.textContent = name;
}

function text(id: string, content: string): void {
  const found = byId(id);
  if (found && found.textContent !== content) found.textContent = content;
}

/** Sets a slider, if a value is given, and colours it up to its value. */
function setSlider(id: string, value?: number): void {
  const slider = byId<HTMLInputElement>(id);
  if (!slider) return;
  if (value !== undefined) slider.value = String(Math.round(value));
  const [low, high] = [Number(slider.min), Number(slider.max)];
  slider.style.setProperty("--done", `${(100 * (slider.valueAsNumber - low)) / (high - low)}%`);
}
