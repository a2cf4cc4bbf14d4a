"""Benchmarks of the plant and of other engines (peers): `python -m benchmarks.run`.

benchmarks/README.md says what may be compared, and why.
"""

import platform
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "bench"

# the ctypes structures of hexapod.h are among the tests, which compare them with the compiler's
# layout
sys.path.append(str(ROOT / "tests" / "support"))
RESULTS = ROOT / "benchmarks" / "results"


def machine() -> str:
    """Returns the name of this machine's folder, made from its processor's name."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        name = re.search(r"model name\s*:\s*(.+)", text)
        family_number, model = (
            re.search(r"cpu family\s*:\s*(\d+)", text),
            re.search(r"model\s*:\s*(\d+)", text),
        )
        words = [match[1] for match in (name, family_number, model) if match]
    except OSError:
        words = [platform.processor() or platform.machine()]
    return re.sub(r"[^a-z0-9]+", "-", "-".join(words).lower()).strip("-")
