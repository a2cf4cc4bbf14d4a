import type { Drive } from "./drive";

/** Keys that move the robot while they are held, by their place on the keyboard. */
const HELD: Record<string, readonly ["forward" | "left" | "turn", number]> = {
  KeyW: ["forward", 1],
  ArrowUp: ["forward", 1],
  KeyS: ["forward", -1],
  ArrowDown: ["forward", -1],
  KeyA: ["turn", 1],
  ArrowLeft: ["turn", 1],
  KeyD: ["turn", -1],
  ArrowRight: ["turn", -1],
  KeyQ: ["left", 1],
  KeyE: ["left", -1],
};

/** Listens to the keyboard; `actions` are done once at a key's press. */
export class Keys {
  private readonly held = new Set<string>();

  constructor(
    private readonly drive: Drive,
    private readonly actions: Readonly<Record<string, () => void>>,
  ) {
    document.addEventListener("keydown", (event) => this.press(event));
    document.addEventListener("keyup", (event) => this.release(event.code));
    // a key that is let go in another window gives no event
    window.addEventListener("blur", () => this.releaseAll());
    document.addEventListener("visibilitychange", () => document.hidden && this.releaseAll());
  }

  /** Presses a key of the page's own pad. */
  hold(code: string): void {
    this.held.add(code);
    this.tell();
  }

  release(code: string): void {
    if (this.held.delete(code)) this.tell();
  }

  private press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || usesKeys(event)) return;
    if (HELD[event.code]) {
      event.preventDefault();
      if (!event.repeat) this.hold(event.code);
      return;
    }
    const act = this.actions[event.code] ?? this.actions[event.key];
    if (!act || (event.repeat && event.code !== "KeyR" && event.code !== "KeyF")) return;
    event.preventDefault();
    act();
  }

  private releaseAll(): void {
    this.held.clear();
    this.tell();
  }

  private tell(): void {
    const axes = { forward: 0, left: 0, turn: 0 };
    for (const code of this.held) {
      const [axis, sign] = HELD[code];
      axes[axis] = Math.min(Math.max(axes[axis] + sign, -1), 1);
    }
    this.drive.axes = axes;
    for (const button of document.querySelectorAll<HTMLElement>("[data-key]"))
      button.classList.toggle("held", this.isHeld(button.dataset.key!));
  }

  /** Whether a key or its twin is held. */
  private isHeld(code: string): boolean {
    const [axis, sign] = HELD[code];
    return [...this.held].some((one) => HELD[one][0] === axis && HELD[one][1] === sign);
  }
}

/** Whether the focused element uses the key itself. */
function usesKeys(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  if (document.querySelector("dialog[open]")) return true;
  if (target.matches("select, input:not([type=range]), textarea")) return true;
  if (target.matches("input[type=range]")) return event.key.startsWith("Arrow");
  return (event.key === " " || event.key === "Enter") && target.matches("button, a, summary");
}
