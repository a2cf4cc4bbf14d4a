import { byId, element } from "../dom";
import { start } from "../live/page";
import { LocalLoop, type StaticSetup } from "./local";
import { Walker } from "./walker";

/** Starts the robot in this page, or says why it cannot walk here. */
async function run(): Promise<void> {
  const setup = JSON.parse(byId("setup")!.textContent!) as StaticSetup;
  try {
    const walker = await Walker.load(byId("module")!.textContent!.trim());
    start(setup, new LocalLoop(walker, setup));
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    byId("stage")?.append(element("p", "refusal", `This browser cannot run the robot: ${reason}`));
  }
}

void run();
