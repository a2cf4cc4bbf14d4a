"""Tests that what the README, the how-to pages and the examples say to type works as typed."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
import zipfile
from functools import partial
from pathlib import Path

import pages
import pytest
from pages import blocks, commands, run, typed

from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.cosim.results.recordings import read_parquet
from hexapod_cosim.cosim.scenario.reading import load_scenario

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = blocks(ROOT / "README.md")
readme_commands = partial(pages.commands, ROOT / "README.md")


@pytest.fixture(scope="module")
def readme_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the README's reader is: the FMU is there from the first command on, and a URDF of
    one's own.
    """
    readme_folder = tmp_path_factory.mktemp("reader")
    run(readme_folder, *shlex.split(readme_commands("hexapod export")[0]))
    typed(readme_folder, "hexapod", "export", "-o", "my.urdf")
    return readme_folder


@pytest.mark.parametrize("command", readme_commands("hexapod export")[1:])
def test_an_export_of_the_readme_writes_its_file(readme_folder: Path, command: str) -> None:
    assert shlex.split(command)[-1] in typed(readme_folder, *shlex.split(command))
    assert zipfile.is_zipfile(readme_folder / shlex.split(command)[-1])


WALK = ["--set", "duration=4", "--set", "outputs.plots=false"]
SHORTER_BY = {"simulate": WALK, "compare": [*WALK, "--seeds", "2"]}
OTHERS = [line for line in readme_commands("hexapod") if line.split()[1] != "export"]


def test_the_readme_shows_every_command_of_the_core_but_validate() -> None:
    assert {line.split()[1] for line in OTHERS} == {
        *("simulate", "list", "terrain", "compare", "report", "controller", "design", "examples")
    }


@pytest.mark.parametrize("command", OTHERS)
def test_a_command_of_the_readme_works(readme_folder: Path, command: str) -> None:
    words = shlex.split(command)
    if words[1] == "report" and not (readme_folder / words[2]).exists():
        compare = next(line for line in OTHERS if line.startswith("hexapod compare"))
        typed(readme_folder, *shlex.split(compare), *SHORTER_BY["compare"])
    assert typed(readme_folder, *words, *SHORTER_BY.get(words[1], []))


def test_the_bare_fmu_simulates(readme_folder: Path) -> None:
    command = shlex.split(
        readme_commands("fmpy simulate")[0].replace("--show-plot", "--output-file result.csv")
    )
    run(readme_folder, *command)
    assert (readme_folder / "result.csv").stat().st_size > 0


def test_the_python_of_the_readme_prints_a_standing_height(readme_folder: Path) -> None:
    _, snippet = (text for kind, text in BLOCKS if kind == "python")
    assert 0.12 < float(run(readme_folder, sys.executable, "-c", snippet)) < 0.14


def test_the_public_call_of_the_readme_writes_a_report(readme_folder: Path) -> None:
    snippet = next(text for kind, text in BLOCKS if kind == "python")
    position, slip = run(readme_folder, sys.executable, "-c", snippet).strip().splitlines()
    assert position.startswith("[")
    assert 0.0 < float(slip) < 1.0
    assert (readme_folder / "out" / "walk" / "report.html").is_file()


def test_the_scenario_of_the_readme_is_valid(readme_folder: Path) -> None:
    (text,) = (text for kind, text in BLOCKS if kind == "toml")
    path = readme_folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert load_scenario(str(path)).settings["gait"]["name"] == "ripple"


# The how-to pages: what can be run here runs as typed, and their links lead somewhere.

PAGES = Path(__file__).parents[2] / "docs" / "howto"
COMMANDS = commands(PAGES / "fmi.md", "fmpy")
PYTHON = [text for kind, text in blocks(PAGES / "fmi.md") if kind == "python"]
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
            ).splitlines()[-1]  # behind fmpy's warnings of inputs that are not in the file
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
    # the figures of a design are drawn in tests/docs/test_typed_commands.py
    monkeypatch.setattr("hexapod_cosim.controller.design.plot_design", lambda *_: [])
    shorter = [*SHORTER] if "simulate" in command else []
    shorter += ["--find", "servo"] if "identify" in command else []
    if "out/identified/" in command:
        leave_identified(robots)
    assert typed(robots, *shlex.split(command), *shorter)
