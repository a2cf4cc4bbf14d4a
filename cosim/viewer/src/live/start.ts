import { LocalLoop, type StaticSetup } from "../browser/local";
import { Robot } from "../browser/robot";
import { byId, element } from "../dom";
import { Link } from "./link";
import type { Setup } from "./messages";
import { start } from "./page";

/** Starts the robot of a page that holds plant and controller, or says why it cannot walk here. */
async function walkHere(setup: StaticSetup, code: string): Promise<void> {
  try {
    start(setup, new LocalLoop(await Robot.load(code), setup));
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    byId("stage")?.append(element("p", "refusal", `This browser cannot run the robot: ${reason}`));
  }
}

/** Connects this page to its robot: a server's, or the one that the page itself holds. */
export function startLive(): void {
  const setup: unknown = JSON.parse(byId("setup")!.textContent!);
  const module = byId("module"); // absent from the page of a server
  if (module) {
    void walkHere(setup as StaticSetup, module.textContent!.trim());
  } else {
    start(setup as Setup, new Link());
  }
}
