"""Makes the tables and figures of the validation page, by the code of the tests."""

from __future__ import annotations

import ctypes
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from tools.docs.stage import ROOT
from tools.docs.validation.shown import Shown

# the robots, motions and problems of the tests
sys.path.extend(str(ROOT / "tests" / room) for room in ("support", "models", "plant"))

from building import built, shared_library

from tools.docs.validation import agreement, impacts, motion, orders

PLACE = re.compile(r"<!-- result: ([\w-]+) -->")
RESULTS: Mapping[str, Callable[[ctypes.CDLL], Shown]] = {
    "motion": motion.closed_forms,
    "restitution": impacts.restitution,
    "gravity": impacts.under_gravity,
    "penetration": impacts.penetration,
    "orders": orders.orders,
    "agreement": agreement.agreement,
}


def fill(folder: Path) -> None:
    """Inserts every result into the page validation.md of a folder."""
    page = folder / "validation.md"
    core = ctypes.CDLL(str(shared_library(built(), "plant_fmu", "libhexapod_c")))

    def place(match: re.Match[str]) -> str:
        shown = RESULTS[match[1]](core)
        return shown.markdown(folder, f"images/validation-{match[1]}")

    page.write_text(PLACE.sub(place, page.read_text(encoding="utf-8")), encoding="utf-8")
