"""A run on disk: what is written when it completes, what when it does not, and how it is read
again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import (
    RUN_FILE,
    RUNNING,
    claim_folder,
    clear_folder,
    read_json,
    write_json,
    write_text,
)
from hexapod_cosim.cosim.common.toml_text import to_toml
from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED, INTERRUPTED
from hexapod_cosim.cosim.results.accuracy import Accuracy, accuracy_of_table
from hexapod_cosim.cosim.results.recordings import (
    COMMANDS,
    read_recording,
    write_commands,
    write_recording,
)
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.models import HexapodError

RESULTS, PARTIAL, METRICS_FILE, SCENARIO = (
    "results",
    "results.partial",
    "metrics.json",
    "scenario.toml",
)
ACCURACY = "accuracy"  # of metrics.json, where it was checked
NEEDED = (
    "title",
    "control",
    "simulated",
    "wall",
    "realtime_factor",
    "finished",
    "gait_period",
    "parameters",
    "robot",
    "fmu",
    "versions",
    "platform",
    "warnings",
)  # of the facts, for a report
ABOUT = ("title", "control", "robot", "fmu", "versions")  # of the facts, in Parquet


@dataclass(frozen=True)
class Stored:
    """A completed run, as a report needs it."""

    view: View
    metrics: Mapping[str, float | None]
    facts: Mapping[str, Any]
    scenario: str  # TOML
    accuracy: Accuracy | None = None  # None: not checked


class Folder:
    """A place for results, in which an earlier run's stay until this one has begun."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.begun = False

    def begin(self) -> None:
        """Clears the folder, once."""
        if not self.begun:
            clear_folder(self.path)
            self.begun = True


@contextmanager
def results_folder(path: Path) -> Iterator[Folder]:
    """A folder whose run.json says so when a run began and the block does not come to its end.
    Raises HexapodError when it cannot be.
    """
    made = claim_folder(path)
    folder = Folder(path)
    try:
        yield folder
    except BaseException as error:
        if folder.begun and read_json(path / RUN_FILE)["status"] == RUNNING:
            status, reason = (
                (INTERRUPTED, "interrupted")
                if isinstance(error, KeyboardInterrupt)
                else (FAILED, str(error))
            )
            write_json(path / RUN_FILE, {"status": status, "reason": reason})
        raise
    finally:
        for place in () if folder.begun else made:
            with suppress(OSError):  # not empty any more
                place.rmdir()


def write_result(result: Result, folder: Path) -> list[Path]:
    """Writes a run into a prepared folder; one that did not complete leaves `results.partial.*` and
    no figures. Returns the files, the scenario first and the recording next. Parquet, from which
    reports are made again, holds all columns; CSV those that outputs.csv names. Commands are
    written where every macro-step is recorded: they hold from row to row.
    """
    facts, outputs, scenario = (
        run_facts(result),
        result.scenario.outputs,
        to_toml(result.scenario.to_table()),
    )
    whole = result.outcome.recording
    write_text(folder / SCENARIO, scenario)
    about = {key: facts[key] for key in ABOUT} | {"scenario": scenario}
    columns, stem = (outputs.csv, RESULTS) if result.completed else (("*",), PARTIAL)
    files = [
        folder / SCENARIO,
        *write_recording(
            whole, folder, stem, formats=outputs.formats, columns=columns, about=about
        ),
    ]
    if result.completed and "csv" in outputs.formats and result.scenario.every == 1:
        files.append(folder / COMMANDS)
        write_commands(whole, files[-1])
    if result.completed:
        files.append(folder / METRICS_FILE)
        write_json(files[-1], dict(result.metrics))
    write_json(folder / RUN_FILE, facts)
    return [*files, folder / RUN_FILE]


def run_facts(result: Result) -> dict[str, Any]:
    """The content of run.json."""
    outcome, scenario = result.outcome, result.scenario
    return {
        "kind": "simulate",
        "status": outcome.status,
        "reason": outcome.reason,
        "title": scenario.title,
        "control": scenario.control,
        "simulated": outcome.simulated,
        "wall": outcome.wall,
        "realtime_factor": outcome.realtime_factor,
        "finished": outcome.finished.isoformat(timespec="seconds"),
        **result.facts,
        "parameters": dict(result.parameters),
    }


def read_result(folder: Path) -> Stored:
    """A completed run from its folder. Raises HexapodError when there is none, or it did not
    complete.
    """
    facts = read_facts(folder)
    if facts["status"] != COMPLETED:
        got = f"{facts['status']}: {facts['reason']}" if facts.get("reason") else facts["status"]
        raise HexapodError(
            "the run did not complete",
            got=got,
            expected="a completed run",
            fix="run it again",
            where=str(folder),
        )
    missing = [name for name in NEEDED if name not in facts]
    if missing:
        raise _damaged(folder / RUN_FILE, f"no {', '.join(missing)}", "all facts of a run")
    metrics = read_json(folder / METRICS_FILE)
    if not isinstance(metrics, dict):
        raise _damaged(folder / METRICS_FILE, type(metrics).__name__, "a table of metrics")
    view = View(read_recording(folder, RESULTS), facts["parameters"], facts["gait_period"])
    checked = metrics.pop(ACCURACY, None)
    accuracy = (
        None if checked is None else accuracy_of_table(checked, where=str(folder / METRICS_FILE))
    )
    return Stored(view, metrics, facts, read_scenario(folder), accuracy)


def read_facts(folder: Path) -> Mapping[str, Any]:
    """What run.json says, its "status" at least. Raises HexapodError when it is missing, damaged
    or of something else.
    """
    facts = read_json(folder / RUN_FILE)
    if not isinstance(facts, dict) or not isinstance(facts.get("status"), str):
        raise _damaged(folder / RUN_FILE, "no status", 'a table with "status"')
    return facts


def read_scenario(folder: Path) -> str:
    """The scenario of a run or a comparison, as TOML. Raises HexapodError when it is missing."""
    try:
        return (folder / SCENARIO).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _damaged(folder / SCENARIO, str(error), "the scenario that was run") from error


def _damaged(path: Path, got: str, expected: str) -> HexapodError:
    return HexapodError(
        "damaged or foreign results",
        got=got,
        expected=expected,
        fix="run the scenario again",
        where=str(path),
    )


def stored(result: Result) -> Stored:
    """The same, straight from a run."""
    facts = run_facts(result)
    return Stored(
        View(result.outcome.recording, result.parameters, facts["gait_period"]),
        result.metrics,
        facts,
        to_toml(result.scenario.to_table()),
    )


def write_accuracy(folder: Path, metrics: Mapping[str, Any], accuracy: Mapping[str, Any]) -> None:
    """Puts what --check-accuracy found beside a folder's metrics."""
    write_json(folder / METRICS_FILE, {**metrics, ACCURACY: accuracy})


def read_accuracies(folder: Path) -> dict[str, Accuracy]:
    """By control, of a comparison's folder; empty where accuracy was not checked. Raises
    HexapodError.
    """
    path = folder / METRICS_FILE
    table = read_json(path)
    checked = table.get(ACCURACY, {}) if isinstance(table, dict) else {}
    return {control: accuracy_of_table(item, where=str(path)) for control, item in checked.items()}
