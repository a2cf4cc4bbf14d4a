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
    const text = `This browser cannot run the robot: ${error instanceof Error ? error.message : error}`;
    byId("stage")?.append(element("p", "refusal", text));
  }
}

void run();
