import { byId, element } from "../../../cosim/viewer/src/dom";
import { Link } from "./link";
import { LocalLoop } from "./local";
import type { Setup, StaticSetup } from "./messages";
import { start } from "./page";

/** Starts the robot of a page that holds plant and controller, or says why it cannot walk here. */
async function walkHere(setup: StaticSetup, base64: string): Promise<void> {
  try {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(bytes, {});
    start(setup, new LocalLoop(instance.exports, setup));
  } catch (error) {
    byId("stage")?.append(element("p", "refusal", `This browser cannot run the robot: ${error}`));
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
