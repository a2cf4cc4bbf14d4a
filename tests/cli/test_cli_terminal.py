"""Output on terminals and in pipes: progress on terminals only, JSON from every command."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command import COMMAND, QUICK, Call, assert_refused
from typer.main import get_command

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.cli import terminal as terminal_module
from hexapod_cosim.cosim.cli.app import app
from hexapod_cosim.cosim.cli.terminal import counting_bar, progress_bar, waiting

ESCAPE = "\x1b"
GROUP: Any = get_command(app)
SHOWN = {name: GROUP.get_command(None, name) for name in GROUP.commands}
# commands of a group count by their own names: "controller new"
COMMANDS = {
    f"{name} {child}".strip(): own
    for name, command in SHOWN.items()
    for child, own in (getattr(command, "commands", {}) or {"": command}).items()
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[[], Terminal]:
    """Replaces stderr by a terminal from within a test, because pytest replaces it before each
    test.
    """

    def install() -> Terminal:
        terminal = Terminal()
        monkeypatch.setenv("COLUMNS", "120")
        monkeypatch.setattr(sys, "stderr", terminal)
        return terminal

    return install


def test_a_run_shows_its_simulated_time(terminal: Callable[[], Terminal]) -> None:
    screen = terminal()
    with progress_bar("kinematic", 8.0) as report:
        assert report is not None
        report(0.0)
        report(2.0)
    assert "2.0 of 8 s" in screen.getvalue()


def test_runs_are_counted_and_those_that_failed(terminal: Callable[[], Terminal]) -> None:
    screen = terminal()
    with counting_bar("seeds", 6) as report:
        report(2)
        report(6, 4)
    assert "6 of 6 runs, 4 failed" in screen.getvalue()


def test_pipes_get_results_and_nothing_else(plant_build: Path, tmp_path: Path) -> None:
    """This holds even where the environment asks for colours."""
    environment = os.environ | {"FORCE_COLOR": "1", "TERM": "xterm-256color"}
    command = [*COMMAND, "simulate", "walk_flat", "-o", str(tmp_path / "out"), *QUICK]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert ESCAPE not in done.stdout + done.stderr
    assert "\r" not in done.stdout + done.stderr
    assert all(line.startswith("warning: ") for line in done.stderr.splitlines())
    assert "wrote " in done.stdout


def test_pipes_get_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = io.StringIO()
    monkeypatch.setattr(sys, "stderr", pipe)
    with (
        counting_bar("seeds", 2) as report,
        progress_bar("kinematic", 1.0) as none,
        waiting("drawing"),
    ):
        report(2)
        assert none is None
    assert pipe.getvalue() == ""


def test_a_log_gets_a_line_of_progress_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    log, clock = io.StringIO(), [0.0]
    monkeypatch.setattr(sys, "stderr", log)
    monkeypatch.setattr(terminal_module, "monotonic", lambda: clock[0])
    with counting_bar("runs", 1000, plain=True) as report:
        for second, done in enumerate(range(100, 200)):
            clock[0] = float(second)
            report(done, 3)
    assert log.getvalue().splitlines() == [
        "runs: 130 of 1000 runs, 3 failed",
        "runs: 160 of 1000 runs, 3 failed",
        "runs: 190 of 1000 runs, 3 failed",
    ]


def test_columns_of_a_table_are_aligned(call: Call) -> None:
    _, table, _ = call("list", "scenarios")
    head, *rows = table.splitlines()
    start = head.index("about")
    assert all(row[start - 1] == " " and row[start] != " " for row in rows)


def test_a_table_too_wide_for_a_terminal_loses_nothing(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, wide, _ = call("list", "laws")
    screen = Terminal()
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setattr(sys, "stdout", screen)
    main(["list", "laws"])
    shown = screen.getvalue()
    assert max(map(len, shown.splitlines())) <= 60
    assert sorted(shown.split()) == sorted(wide.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_speaks_json(name: str) -> None:
    assert any("--json" in option.opts for option in COMMANDS[name].params)


@pytest.mark.parametrize(
    "arguments",
    [
        ["export", "-o", "athena.fmu"],
        ["export", "--urdf"],
        ["export", "--controller", "kinematic"],
        ["export", "--ssp", "--controller", "kinematic"],
        ["list", "laws"],
        ["simulate", "stand", *QUICK],
    ],
    ids=" ".join,
)
def test_json_is_all_that_is_printed(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = call(*arguments, "--json")
    assert code == 0
    assert json.loads(out)


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (
            ["simulate", "--nope"],
            ["No such option: --nope", "hexapod simulate [OPTIONS]", "`hexapod simulate --help`"],
        ),
        (["simulat"], ["got 'simulat'", "one of export, simulate", "did you mean 'simulate'"]),
        (["export", "--fmi", "two"], ["--fmi", "integer"]),
        (["simulate", "stand", "walk_flat"], ["(walk_flat)", "[SCENARIO]"]),
        (["simulate", "--set"], ["'--set' requires an argument"]),
        (["report"], ["Missing argument 'DIR'"]),
        (
            ["report", "nowhere"],
            [
                "not a results folder",
                "got 'nowhere'",
                "run.json",
                "of `hexapod` wrote, such as simulate",
            ],
        ),
        (
            ["report", "broken"],
            ["run.json: damaged file", "expected JSON", "run the scenario again"],
        ),
        (
            ["report", "failed"],
            ["failed: ", "did not complete", "got 'failed: it fell'", "run it again"],
        ),
        (
            ["report", "foreign"],
            [
                "damaged or foreign results",
                "a file without ",
                "all facts of a run",
                "run the scenario again",
            ],
        ),
        (["validate", "file"], ["not an FMU", "ZIP"]),
        (["simulate", "--gains", "file"], ["not a TOML file", "TOML 1.0"]),
        (["simulate", "file"], ["not a TOML file", "correct it at"]),
    ],
)
def test_a_misuse_is_reported_in_one_paragraph_of_what_got_expected_and_fix(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    parts: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("root:x:0", encoding="utf-8")
    facts = {
        "broken": "{",
        "failed": '{"status": "failed", "reason": "it fell"}',
        "foreign": '{"status": "completed"}',
    }
    for name, text in facts.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").write_text(text, encoding="utf-8")
        (tmp_path / name / "metrics.json").write_text("{}", encoding="utf-8")
    outcome = call(*arguments)
    assert_refused(outcome, *parts, "got ", "expected ")
    assert outcome[2].rpartition("; ")[2].strip()  # the fix
