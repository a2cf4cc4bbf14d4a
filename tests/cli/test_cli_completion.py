"""Tests shell completion, as the shells request it, and the examples that
hexapod examples copies.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command import COMMAND, Call

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.scenario import list_scenarios
from hexapod_cosim.models import list_robots

Ask = Callable[..., list[str]]
SLOW = {"numpy", "scipy", "control", "matplotlib", "pyarrow", "mujoco", "pinocchio"}
SHELLS = {"bash": ".bashrc", "zsh": ".zshrc", "fish": ".config/fish/completions/hexapod.fish"}


@pytest.fixture
def offered(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Ask:
    """Returns the completions of bash for words of which the last is incomplete."""

    def ask(*words: str) -> list[str]:
        monkeypatch.setenv("COMP_WORDS", " ".join(["hexapod", *words]))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        monkeypatch.setenv("_HEXAPOD_COMPLETE", "complete_bash")
        assert main([]) == 0
        out, err = capsys.readouterr()
        assert err == ""
        return out.split()

    return ask


def test_names_are_offered_where_they_go(offered: Ask) -> None:
    assert set(offered("simulate", "")) == set(offered("compare", "")) == set(list_scenarios())
    assert offered("simulate", "walk_f") == ["walk_flat"]
    assert offered("export", "--robot", "") == offered("design", "--robot", "") == list_robots()
    assert (
        offered("simulate", "--control", "c")
        == offered("export", "--controller", "c")
        == ["compliant"]
    )
    assert offered("list", "sc") == ["scenarios"]
    assert "simulate" in offered("")
    assert "--output" in offered("simulate", "--")


def test_keys_of_set_are_those_of_the_scenario_and_of_the_fmu(offered: Ask) -> None:
    assert offered("simulate", "--set", "dura") == ["duration="]
    assert {"gait.name=", "gait.period="} <= set(offered("compare", "--set", "gait."))
    assert offered("simulate", "--set", "gravity") == [
        "gravity=",
        "gravity[1]=",
        "gravity[2]=",
        "gravity[3]=",
    ]
    assert offered("simulate", "--set", "LF.coxa.m") == ["LF.coxa.mass="]
    assert offered("simulate", "--set", "torso.push") == []  # an input


def ask_shell(shell: str, typed: str) -> list[str]:
    environment = os.environ | {
        "_HEXAPOD_COMPLETE": f"complete_{shell}",
        "_TYPER_COMPLETE_ARGS": typed,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(typed.split(" ")) - 1),
    }
    return subprocess.run(
        COMMAND, env=environment, capture_output=True, text=True, check=True
    ).stdout.splitlines()


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shells_protocol_is_answered(shell: str) -> None:
    found = ask_shell(shell, "hexapod simulate walk_f")
    assert any("walk_flat" in line for line in found)
    assert not any("wave" in line for line in found)


@pytest.mark.parametrize(("shell", "file"), SHELLS.items(), ids=list(SHELLS))
def test_completion_is_installed_for_every_shell(tmp_path: Path, shell: str, file: str) -> None:
    environment = os.environ | {
        "HOME": str(tmp_path),
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
    }
    subprocess.run(
        [*COMMAND, "--install-completion", shell],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert (tmp_path / file).is_file()
    assert any(
        "_HEXAPOD_COMPLETE" in path.read_text() for path in tmp_path.rglob("*") if path.is_file()
    )


@pytest.mark.parametrize("words", ["hexapod --help", "hexapod sim", "hexapod simulate --se"])
def test_help_and_completion_import_nothing_slow(words: str) -> None:
    """Not even NumPy: a command imports what it needs when it is called."""
    script = (
        "import sys; from hexapod_cosim.cosim.cli import main; main(['--help'] if 'help' in "
        f"'{words}' else []); print(*(name.partition('.')[0] for name in sys.modules))"
    )
    environment = dict(os.environ)
    if "help" not in words:
        environment |= {
            "COMP_WORDS": words,
            "COMP_CWORD": str(len(words.split()) - 1),
            "_HEXAPOD_COMPLETE": "complete_bash",
        }
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert not SLOW & set(done.stdout.split())


# `hexapod examples` copies what comes with the package into a folder of its own.


def test_examples_are_copied_as_they_are(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("examples", "-o", tmp_path / "mine", "--json")
    assert code == 0
    names = {
        Path(name).relative_to(tmp_path / "mine").as_posix() for name in json.loads(out)["files"]
    }
    assert {"02_walk.py", "controllers/cpg.py", "notebooks/first_walk.ipynb"} <= names
    assert not any("__pycache__" in name for name in names)
    source = Path(__file__).parents[2] / "examples" / "02_walk.py"
    assert (tmp_path / "mine" / "02_walk.py").read_bytes() == source.read_bytes()


def test_a_folder_with_files_is_refused_and_left_alone(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    code, _, err = call("examples", "-o", tmp_path)
    assert code == 1
    assert "a new or an empty folder" in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
