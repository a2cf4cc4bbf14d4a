"""The how-to pages: what can be run here runs as typed, and their links lead somewhere."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[1] / "docs" / "howto"
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", (PAGES / "fmpy.md").read_text(encoding="utf-8"), flags=re.DOTALL)
COMMANDS = [line for kind, text in BLOCKS if not kind for line in text.splitlines() if line.startswith("fmpy ")]
PYTHON = [text for kind, text in BLOCKS if kind == "python"]
SHORT = "0.5"  # s


def run(folder: Path, *arguments: str) -> str:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False, env=os.environ | {"PATH": path})
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def folder(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the reader is: the FMU and a recorded walk are there."""
    folder = tmp_path_factory.mktemp("reader")
    run(folder, "hexapod", "export", "-o", "athena.fmu")
    run(folder, "hexapod", "simulate", "walk_flat", "--set", f"duration={SHORT}", "-o", "out/walk")
    return folder


def test_the_page_on_fmpy_has_commands_and_code() -> None:
    assert len(COMMANDS) >= 4
    assert len(PYTHON) == 1


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_page_on_fmpy_works(folder: Path, command: str) -> None:
    run(folder, *shlex.split(re.sub(r"--stop-time \d+", f"--stop-time {SHORT}", command.replace("--show-plot", ""))))


def test_the_code_of_the_page_on_fmpy_walks(folder: Path) -> None:
    shorter = PYTHON[0].replace("stop_time=10.0", f"stop_time={SHORT}")
    assert shorter != PYTHON[0]
    assert float(run(folder, sys.executable, "-c", shorter + '\nprint(abs(result["torso.position[1]"][-1]))')) > 1e-3


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    links = [link for link in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")) if "://" not in link]
    assert all((PAGES / link).exists() for link in links), links
