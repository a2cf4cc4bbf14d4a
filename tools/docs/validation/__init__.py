"""Makes the tables and figures of the validation page.

The code of the tests computes them, or they are read from the results of the benchmarks.
"""

from __future__ import annotations

import ctypes
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from tools.docs.stage import ROOT
from tools.docs.validation.shown import Shown

# the robots, motions and problems of the tests
sys.path.extend(
    str(ROOT / "tests" / room)
    for room in ("support", "models", "plant", "controller", "cosim", "design")
)

from building import built, shared_library

from tools.docs.validation import (
    agreement,
    benchmarks,
    books,
    control,
    drive,
    effort,
    impacts,
    motion,
    orders,
    quoted,
    robots,
)

PLACE = re.compile(r"<!-- result: ([\w-]+) -->")
COMPUTED: Mapping[str, Callable[[ctypes.CDLL], Shown]] = {
    "motion": motion.closed_forms,
    "restitution": impacts.restitution,
    "gravity": impacts.under_gravity,
    "penetration": impacts.penetration,
    "orders": orders.orders,
    "agreement": agreement.agreement,
}
READ: Mapping[str, Callable[[], Shown]] = {
    "books": books.books,
    "books-of-scenarios": books.scenarios,
    **quoted.RESULTS,
    **control.RESULTS,
    **drive.RESULTS,
    **effort.RESULTS,
    **robots.RESULTS,
    "peers": benchmarks.peers,
    "speed": benchmarks.speed,
    "control": benchmarks.control,
}


def fill(folder: Path) -> None:
    """Inserts every result into the page validation.md of a folder."""
    page, core = (
        folder / "validation.md",
        ctypes.CDLL(str(shared_library(built(), "plant_fmu", "libhexapod_c"))),
    )

    def place(match: re.Match[str]) -> str:
        name = match[1]
        shown = COMPUTED[name](core) if name in COMPUTED else READ[name]()
        return shown.markdown(folder, f"images/validation-{name}")

    page.write_text(PLACE.sub(place, page.read_text(encoding="utf-8")), encoding="utf-8")
