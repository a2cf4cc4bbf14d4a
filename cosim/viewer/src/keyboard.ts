import type { Clock } from "./clock";
import { listenToHelp } from "./dom";

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
