"""The how-to pages: what can be run here runs as typed, and their links lead somewhere."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from pages import blocks, commands, run, typed

from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.cosim.results.recordings import read_parquet

PAGES = Path(__file__).parents[2] / "docs" / "howto"
COMMANDS = commands(PAGES / "fmpy.md", "fmpy")
PYTHON = [text for kind, text in blocks(PAGES / "fmpy.md") if kind == "python"]
SHORT = "0.5"  # s
SHORTER = ["--set", f"duration={SHORT}", "--set", "outputs.plots=false"]


@pytest.fixture(scope="module")
def folder(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the reader is: the FMU and a recorded walk are there."""
    folder = tmp_path_factory.mktemp("reader")
    typed(folder, "hexapod", "export", "-o", "athena.fmu")
    typed(folder, "hexapod", "simulate", "walk_flat", *SHORTER, "-o", "out/walk")
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_page_on_fmpy_works(folder: Path, command: str) -> None:
    run(
        folder,
        *shlex.split(
            re.sub(r"--stop-time \d+", f"--stop-time {SHORT}", command.replace("--show-plot", ""))
        ),
    )


def test_the_code_of_the_page_on_fmpy_walks(folder: Path) -> None:
    shorter = PYTHON[0].replace("stop_time=10.0", f"stop_time={SHORT}")
    assert shorter != PYTHON[0]
    assert (
        float(
            run(
                folder,
                sys.executable,
                "-c",
                shorter + '\nprint(abs(result["torso.position[1]"][-1]))',
            )
        )
        > 1e-3
    )


@pytest.fixture(scope="module")
def robots(folder: Path) -> Path:
    """Where a reader with a robot of one's own is: it lies there as a robot file and as a URDF."""
    shutil.copy(Path(__file__).parents[2] / "models" / "athena.toml", folder / "my.toml")
    typed(folder, "hexapod", "export", "-o", "my.urdf")
    walk = read_parquet(folder / "out" / "walk" / "results.parquet")
    write_mcap(walk.chosen(["*.angle_ref", "*.speed_ref", "*.coxa.angle"]), folder / "log.mcap")
    shutil.copy(folder / "log.mcap", folder / "log2.mcap")
    return folder


def leave_identified(folder: Path) -> None:
    """Writes what the identification of the page leaves, where it is missing: the commands of
    tests are shorter, and may run in another process.
    """
    place = folder / "out" / "identified"
    place.mkdir(parents=True, exist_ok=True)
    if not (place / "robot.toml").exists():
        shutil.copy(folder / "my.toml", place / "robot.toml")


@pytest.mark.parametrize(
    "command",
    [
        line
        for page in ("my-robot.md", "urdf.md", "libcosim_ecos.md")
        for line in commands(PAGES / page, "hexapod")
    ],
)
def test_a_command_of_the_pages_on_robots_and_packages_works(
    robots: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the figures of a design are drawn in tests/docs/test_readme.py
    monkeypatch.setattr("hexapod_cosim.controller.design.plot_design", lambda *_: [])
    shorter = [*SHORTER] if "simulate" in command else []
    shorter += ["--find", "servo"] if "identify" in command else []
    if "out/identified/" in command:
        leave_identified(robots)
    assert typed(robots, *shlex.split(command), *shorter)
