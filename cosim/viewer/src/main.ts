import { byId } from "./dom";
import { startReport } from "./report";

// One bundle serves all kinds of pages, so that a wheel holds the libraries once. A report has its
// recording inside; tools/build_viewer.py adds the pages of the extensions.
if (byId("recording")) startReport();
