import { type Drive, NONE } from "./drive";

const DEAD = 0.15; // share of a stick's way around its middle that counts as its middle
const RISE = 0.02; // of the largest height, in each picture that the cross is held

/** Buttons of the standard mapping that act once at their press. */
export type Buttons = Readonly<Record<number, () => void>>;

/**
 * Reads the first gamepad in each picture. Left stick: forward and sideways; right stick: turn;
 * the cross: height; `buttons`: what the others do.
 */
export class Pad {
  private pressed: boolean[] = [];
  private active = false;

  constructor(
    private readonly drive: Drive,
    private readonly buttons: Buttons,
    private readonly noticed: (name: string) => void,
  ) {
    window.addEventListener("gamepadconnected", ({ gamepad }) => noticed(gamepad.id));
    window.addEventListener("gamepaddisconnected", () => this.release());
  }

  /** Reads the gamepad as it is now. */
  read(): void {
    const pad = navigator.getGamepads().find((one) => one?.connected);
    if (!pad) {
      if (this.active) this.release();
      return;
    }
    if (!this.active) this.noticed(pad.id);
    this.active = true;
    const axis = (k: number) => shaped(pad.axes[k] ?? 0);
    this.drive.set("gamepad", { forward: -axis(1), left: -axis(0), turn: -axis(2) });
    const down = pad.buttons.map(({ pressed }) => pressed);
    if (down[12]) this.drive.height += RISE;
    if (down[13]) this.drive.height -= RISE;
    for (const [button, act] of Object.entries(this.buttons))
      if (down[Number(button)] && !this.pressed[Number(button)]) act();
    this.pressed = down;
  }

  private release(): void {
    this.active = false;
    this.pressed = [];
    this.drive.set("gamepad", NONE);
    this.noticed("");
  }
}

/** Returns an axis without its dead zone, fine near the middle. */
function shaped(value: number): number {
  const size = Math.max(Math.abs(value) - DEAD, 0) / (1 - DEAD);
  return Math.sign(value) * size ** 1.5;
}
