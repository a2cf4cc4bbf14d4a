import { byId } from "../../../cosim/viewer/src/dom";
import { type Drive, NONE } from "./drive";

const DEAD = 0.12; // share of a stick's way around its middle that counts as its middle

/** Two sticks on the screen: the left one walks, the right one turns. */
export function listenToTouch(drive: Drive): void {
  stick("stick-walk", (x, y) =>
    drive.set("stick-walk", x === 0 && y === 0 ? NONE : { forward: -y, left: -x, turn: 0 }),
  );
  stick("stick-turn", (x) =>
    drive.set("stick-turn", x === 0 ? NONE : { forward: 0, left: 0, turn: -x }),
  );
}

/** Calls `move` with a stick's deflection, each part from -1 to 1; x to the right, y downwards. */
function stick(id: string, move: (x: number, y: number) => void): void {
  const base = byId(id);
  const knob = base?.querySelector<HTMLElement>("i");
  if (!base || !knob) return;
  let pointer: number | undefined;
  const show = (x: number, y: number) => {
    knob.style.transform = `translate(${55 * x}%, ${55 * y}%)`;
    move(Math.abs(x) < DEAD ? 0 : x, Math.abs(y) < DEAD ? 0 : y);
  };
  const follow = (event: PointerEvent) => {
    if (event.pointerId !== pointer) return;
    const { left, top, width, height } = base.getBoundingClientRect();
    const x = (2 * (event.clientX - left)) / width - 1;
    const y = base.dataset.axis === "x" ? 0 : (2 * (event.clientY - top)) / height - 1;
    const length = Math.max(Math.hypot(x, y), 1);
    show(x / length, y / length);
  };
  const release = (event: PointerEvent) => {
    if (event.pointerId !== pointer) return;
    pointer = undefined;
    base.classList.remove("held");
    show(0, 0);
  };
  base.addEventListener("pointerdown", (event) => {
    pointer = event.pointerId;
    base.setPointerCapture(pointer);
    base.classList.add("held");
    event.preventDefault();
    follow(event);
  });
  base.addEventListener("pointermove", follow);
  base.addEventListener("pointerup", release);
  base.addEventListener("pointercancel", release);
}
