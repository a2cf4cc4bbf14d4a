import { byId, element, listenToHelp } from "../../../cosim/viewer/src/dom";
import { Theme } from "../../../cosim/viewer/src/theme";
import { Drive, Keys } from "./drive";
import type { Connection } from "./link";
import type { Frame, Setup, World } from "./messages";
import { Panel } from "./panel";
import { Pusher, View } from "./view";

const RISE = 0.1; // of the largest height, at a press of a key
const PACE = 0.05; // of the largest speed, at a press of a key

/** Connects the page's parts with each other and with the loop. */
export function start(setup: Setup, link: Connection): void {
  const theme = new Theme(byId<HTMLButtonElement>("theme"));
  const drive = new Drive(link);
  const panel = new Panel(setup, link, drive);
  const view = makeView();
  const shown: { world?: World; frame?: Frame } = {};
  link.on("world", (world) => {
    shown.world = world;
    void view?.build(world);
  });
  link.on("frame", (frame) => {
    shown.frame = frame;
    panel.showFrame(frame);
    document.documentElement.dataset.ready = "true";
  });
  theme.listen(() => view?.paint());
  const keys = new Keys(drive, actionsOf(drive, panel, theme, view));
  listenToPad(keys);
  const pusher = view && new Pusher(view, link, () => shown.world?.weight ?? 0);
  listenToHelp();
  byId("home")?.addEventListener("click", () => view?.eye.home());
  const picture = (): void => {
    pusher?.renew();
    if (shown.frame) view?.draw(shown.frame);
    requestAnimationFrame(picture);
  };
  requestAnimationFrame(picture);
  Object.assign(window, { hexapod: { link, view, shown } });
}

/** Returns the 3D view, or shows why there is none. */
function makeView(): View | undefined {
  try {
    return new View(byId("stage")!);
  } catch {
    const text = "This browser has no WebGL, so the robot is not drawn. Keys work.";
    byId("stage")?.append(element("p", "refusal", text));
    return undefined;
  }
}

function actionsOf(
  drive: Drive,
  panel: Panel,
  theme: Theme,
  view: View | undefined,
): Record<string, () => void> {
  const gaits = ["Digit1", "Digit2", "Digit3", "Digit4"];
  const chosen = (k: number) => () => {
    byId("gaits")?.querySelectorAll<HTMLButtonElement>("button")[k]?.click();
  };
  return {
    ...Object.fromEntries(gaits.map((code, k) => [code, chosen(k)])),
    KeyC: () => panel.next("control"),
    KeyR: () => {
      drive.height += RISE;
    },
    KeyF: () => {
      drive.height -= RISE;
    },
    "+": () => {
      drive.speed += PACE;
    },
    "-": () => {
      drive.speed -= PACE;
    },
    Space: () => panel.act("pause"),
    Backspace: () => panel.act("place"),
    KeyH: () => view?.eye.home(),
    KeyT: () => theme.toggle(),
    "?": () => byId("help-button")?.click(),
  };
}

/** Lets the page's pad of keys be pressed with a pointer. */
function listenToPad(keys: Keys): void {
  for (const button of document.querySelectorAll<HTMLElement>("[data-key]")) {
    const code = button.dataset.key!;
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      keys.press(code);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      button.addEventListener(name, () => keys.release(code));
  }
}
