import type { Vector3 } from "three";
import type { Connection } from "./link";
import type { View } from "./view";

const MOST_WEIGHTS = 3; // body weights    largest push
const OFTEN = 40; // ms    between two pushes at the most
const RENEW = 300; // ms    between two that are the same

/** Pushes the robot while a pointer drags from it: along the ground, with shift upwards. */
export class Pusher {
  private pointer = -1;
  private offset: Vector3 | undefined;
  private event: PointerEvent | undefined;
  private sent = "";
  private at = 0;

  constructor(
    private readonly view: View,
    private readonly link: Connection,
    private readonly weight: () => number,
  ) {
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.begin(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"] as const)
      canvas.addEventListener(name, (event) => this.end(event));
  }

  /** Sends the push of a drag that goes on; the robot may move away below the pointer. */
  renew(): void {
    if (this.event) this.send(this.event);
  }

  private begin(event: PointerEvent): void {
    const hit = event.button === 0 ? this.view.hit(event) : undefined;
    if (!hit) return;
    event.stopImmediatePropagation(); // the drag does not turn the view as well
    this.view.canvas.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.offset = hit.clone().sub(this.view.ground);
    this.event = event;
    this.view.canvas.classList.add("pushing");
  }

  private move(event: PointerEvent): void {
    if (event.pointerId === this.pointer) this.event = event;
    else if (event.buttons === 0)
      this.view.canvas.classList.toggle("grip", this.view.hit(event) !== undefined);
  }

  private end(event: PointerEvent): void {
    if (event.pointerId !== this.pointer) return;
    this.pointer = -1;
    this.event = undefined;
    this.sent = "";
    this.view.canvas.classList.remove("pushing");
    this.link.send({ type: "push", x: 0, y: 0, z: 0 });
  }

  private send(event: PointerEvent): void {
    const now = performance.now();
    if (!this.offset || now - this.at < OFTEN) return;
    const grip = this.offset.clone().add(this.view.ground);
    const share = this.view.pull(event, grip, event.shiftKey).clampLength(0, MOST_WEIGHTS);
    const force = share.multiplyScalar(this.weight());
    const [x, y, z] = force.toArray().map((part) => Math.round(100 * part) / 100);
    const text = JSON.stringify([x, y, z]);
    if (text === this.sent && now - this.at < RENEW) return;
    [this.sent, this.at] = [text, now];
    this.link.send({ type: "push", x, y, z });
  }
}
