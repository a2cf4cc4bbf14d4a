"""The folder of this machine's results."""

from __future__ import annotations

import platform
import re
from pathlib import Path

from benchmarks import ROOT

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
