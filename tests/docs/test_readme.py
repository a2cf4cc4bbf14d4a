"""What the README says to type works as typed."""

from __future__ import annotations

import shlex
import sys
import zipfile
from functools import partial
from pathlib import Path

import pages
import pytest
from pages import blocks, run, typed

from hexapod_cosim.cosim.scenario.reading import load_scenario

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = blocks(ROOT / "README.md")
commands = partial(pages.commands, ROOT / "README.md")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the README's reader is: the FMU is there from the first command on, and a URDF of
    one's own.
    """
    folder = tmp_path_factory.mktemp("reader")
    run(folder, *shlex.split(commands("hexapod export")[0]))
    typed(folder, "hexapod", "export", "-o", "my.urdf")
    return folder


@pytest.mark.parametrize("command", commands("hexapod export")[1:])
def test_an_export_of_the_readme_writes_its_file(folder: Path, command: str) -> None:
    assert shlex.split(command)[-1] in typed(folder, *shlex.split(command))
    assert zipfile.is_zipfile(folder / shlex.split(command)[-1])


@pytest.mark.parametrize(
    "command",
    [
        line
        for line in commands("hexapod")
        if "simulate" in line or "list" in line or "design" in line
    ],
)
def test_a_command_of_the_readme_works(folder: Path, command: str) -> None:
    shorter = ["--set", "duration=4", "--set", "outputs.plots=false"]
    assert typed(folder, *shlex.split(command), *(shorter if "simulate" in command else []))


def test_the_bare_fmu_simulates(folder: Path) -> None:
    command = shlex.split(
        commands("fmpy simulate")[0].replace("--show-plot", "--output-file result.csv")
    )
    run(folder, *command)
    assert (folder / "result.csv").stat().st_size > 0


def test_the_python_of_the_readme_prints_a_standing_height(folder: Path) -> None:
    _, snippet = (text for kind, text in BLOCKS if kind == "python")
    assert 0.12 < float(run(folder, sys.executable, "-c", snippet)) < 0.14


def test_the_public_call_of_the_readme_writes_a_report(folder: Path) -> None:
    snippet = next(text for kind, text in BLOCKS if kind == "python")
    position, slip = run(folder, sys.executable, "-c", snippet).strip().splitlines()
    assert position.startswith("[")
    assert 0.0 < float(slip) < 1.0
    assert (folder / "out" / "walk" / "report.html").is_file()


def test_the_scenario_of_the_readme_is_valid(folder: Path) -> None:
    (text,) = (text for kind, text in BLOCKS if kind == "toml")
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert load_scenario(str(path)).settings["gait"]["name"] == "ripple"
