import { byId, element } from "../../../cosim/viewer/src/dom";
import { Link } from "./link";
import { LocalLoop, type StaticSetup } from "./local";
import type { Setup } from "./messages";
import { start } from "./page";
import { Robot } from "./robot";

/** Starts the robot of a page that holds plant and controller, or says why it cannot walk here. */
async function walkHere(setup: StaticSetup, code: string): Promise<void> {
  try {
    start(setup, new LocalLoop(await Robot.load(code), setup));
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    byId("stage")?.append(element("p", "refusal", `This browser cannot run the robot: ${reason}`));
  }
}

// connects this page to its robot: a server's, or the one that the page itself holds
const setup = byId("setup"); // absent from reports
const module = byId("module"); // absent from the page of a server
if (setup && module) {
  void walkHere(JSON.parse(setup.textContent!) as StaticSetup, module.textContent!.trim());
} else if (setup) {
  start(JSON.parse(setup.textContent!) as Setup, new Link());
}
