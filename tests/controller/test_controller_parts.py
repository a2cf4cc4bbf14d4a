"""A part of the controller is named in few files: it can be added or removed by editing these."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from hexapod_cosim.controller import Parts

ROOT = Path(__file__).resolve().parents[2]
MOST = 6  # files that name a part, of code and pages
# what names a part in code: its switch, its modules, its structures and functions in C
NAMES = {
    "support": r"comply\.support|\bSupport\b|hx_support_|hxSupport|SupportGains|/support\.h",
    "touchdown": r"sense\.touchdown|\bTouchdown\b|hx_touchdown_|hxTouchdown|/touchdown\.h",
    "posture": r"walk\.hold|\bHold\b|hx_hold_|hxHold|HoldGains|/hold\.h",
    "path": r"walk\.hold|\bHold\b|hx_hold_|hxHold|HoldGains|/hold\.h",
    "sway": r"\bsway\b|\bSway\b|hx_sway_|hxSway",
    "fallback": r"sense\.trust|\bTrust\b|hx_trust_|hxTrust|SensorWatch|hx_sensor_watch|/trust\.h",
    "limits": r"\bLimitGains\b",
    "squeeze": r"planned_squeeze|PlannedSqueeze",
    "paper_share": r"\bpaper_share\b",
    "paper_pid": r"\bpaper_pid\b",
    "paper_suspension": r"\bpaper_suspension\b",
}


def sources() -> list[Path]:
    """The files of the controller that are written by hand, and its pages."""
    folders = (
        (ROOT / "controller", "*.*"),
        (ROOT / "docs", "control*.md"),
        (ROOT / "docs/control", "*.md"),
    )
    kinds = {".py", ".c", ".h", ".toml", ".txt", ".md"}
    files = {file for folder, name in folders for file in folder.rglob(name)}
    return sorted(
        file
        for file in files
        if file.suffix in kinds and not {"generated", "design"} & set(file.parts)
    )


def names(file: Path, part: str) -> bool:
    """Whether a file names a part."""
    switch = rf"`(compliance\.)?{part}\b"
    if file.suffix != ".md":
        switch = rf"parts(\.|->){part}\b|^    {part}: Annotated|{NAMES[part]}"
    return re.search(switch, file.read_text(encoding="utf-8"), re.MULTILINE) is not None


@pytest.mark.parametrize("part", [item.name for item in fields(Parts)])
def test_a_part_is_named_in_six_files_at_most(part: str) -> None:
    found = [file.relative_to(ROOT) for file in sources() if names(file, part)]
    assert len(found) <= MOST, [str(file) for file in found]
    assert Path("controller/gains.py") in found
    assert {file.suffix for file in found} == {".py", ".h", ".md"}
