import { byId } from "./dom";
import { startLive } from "./live/start";
import { startReport } from "./report";

// One bundle serves both kinds of pages, so that a wheel holds the libraries once. A live page
// has its setup inside, a report its recording.
if (byId("setup")) {
  startLive();
} else {
  startReport();
}
