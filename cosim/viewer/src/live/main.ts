import { byId } from "../dom";
import { Link } from "./link";
import type { Setup } from "./messages";
import { start } from "./page";

start(JSON.parse(byId("setup")!.textContent!) as Setup, new Link());
