"""Writes a run to a folder and reads it back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import (
    RESULT_FILES,
    RUN_FILE,
    RUNNING,
    claim_folder,
    clear_folder,
    read_json,
    why_unreadable,
    write_json,
    write_text,
)
from hexapod_cosim.cosim.common.temporary import lock_folder
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.logs.mcap_writer import OURS
from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED, INTERRUPTED
from hexapod_cosim.cosim.results.accuracy import Accuracy, accuracy_from_table
from hexapod_cosim.cosim.results.facts import Result, RunFacts, facts_from_table
from hexapod_cosim.cosim.results.ground import around_walk, read_ground, write_ground
from hexapod_cosim.cosim.results.recordings import (
    COMMANDS,
    read_recording,
    write_commands,
    write_recording,
)
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.files import read_text

RESULTS, PARTIAL = "results", "results.partial"  # stems of recordings
METRICS_FILE, SCENARIO = "metrics.json", "scenario.toml"
ACCURACY = "accuracy"  # key of metrics.json, where accuracy was checked
WARNINGS = "warnings"  # key of metrics.json: the run's, as in run.json
ABOUT = ("title", "control", "robot", "fmu", "versions")  # facts in the Parquet file


@dataclass(frozen=True)
class StoredResult:
    """A completed run with all that a report needs."""

    view: View
    metrics: Mapping[str, float | None]
    facts: RunFacts
    scenario: str  # TOML
    accuracy: Accuracy | None = None  # None: not checked


class ResultsFolder:
    """A folder for results, which keeps those of an earlier run until the new run has begun."""

    def __init__(self, path: Path, parts: Sequence[str] = (), own: Sequence[str] = ()) -> None:
        self.path = path
        self.begun = False
        self._parts, self._files = parts, (*RESULT_FILES, *own)

    def begin(self) -> None:
        """Clears the folder at the first call."""
        if not self.begun:
            clear_folder(self.path, self._parts, self._files)
            self.begun = True


@contextmanager
def results_folder(
    path: Path, parts: Sequence[str] = (), own: Sequence[str] = ()
) -> Iterator[ResultsFolder]:
    """Claims a folder for a run; if the block fails once the run has begun, run.json says so.

    `parts`: names of the folders in it that a comparison writes; `own`: files that the command
    writes besides RESULT_FILES. Raises HexapodError when the folder cannot be used.
    """
    made = claim_folder(path)
    folder = ResultsFolder(path, parts, own)
    with locked(path):
        try:
            yield folder
        except BaseException as error:
            facts = read_json(path / RUN_FILE) if folder.begun else {}
            if facts.get("status") == RUNNING:
                status, reason = FAILED, str(error)
                if isinstance(error, KeyboardInterrupt):
                    status, reason = INTERRUPTED, "interrupted"
                write_json(path / RUN_FILE, {**facts, "status": status, "reason": reason})
            raise
        finally:
            for place in () if folder.begun else made:
                with suppress(OSError):  # no longer empty
                    place.rmdir()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Locks a folder: within the block no other process writes its results into it.

    Raises HexapodError when another process has locked it.
    """
    release = lock_folder(folder)
    if release is None:
        raise HexapodError(
            "another process writes its results into this folder",
            got=str(folder),
            fix="wait for it, or choose another with -o",
        )
    try:
        yield
    finally:
        release()


def write_result(result: Result, folder: Path) -> list[Path]:
    """Writes a run into a prepared folder and returns the files: scenario, recording, others.

    A run that did not complete leaves `results.partial.*` and no metrics. Parquet and MCAP, from
    which reports are made again, hold all columns; CSV holds those that outputs.csv names.
    Commands are written only where every macro-step is recorded, since they hold from row to row.
    """
    facts, outputs = result.facts.as_table(), result.scenario.outputs
    scenario, recording = tomlkit.dumps(result.scenario.to_table()), result.outcome.recording
    write_text(folder / SCENARIO, scenario)
    about = {key: facts[key] for key in ABOUT} | {"scenario": scenario}
    columns, stem = (outputs.csv, RESULTS) if result.completed else (("*",), PARTIAL)
    files = [folder / SCENARIO]
    files += write_recording(
        recording,
        folder,
        stem,
        formats=outputs.formats,
        columns=columns,
        about=about,
        joints=load_robot(result.scenario.robot).joints if "mcap" in outputs.formats else OURS,
        torso_com=[result.parameters.get(name, 0.0) for name in vector_names("torso.com")],
    )
    if result.completed and "csv" in outputs.formats and result.scenario.every == 1:
        files.append(folder / COMMANDS)
        write_commands(recording, files[-1])
    files += write_ground(result.surface, recording, folder)
    if result.completed:
        files.append(folder / METRICS_FILE)
        write_json(files[-1], {**result.metrics, WARNINGS: facts[WARNINGS]})
    write_json(folder / RUN_FILE, facts)
    return [*files, folder / RUN_FILE]


def read_result(folder: Path) -> StoredResult:
    """Reads a completed run from its folder.

    Raises HexapodError when there is none or it did not complete.
    """
    table = read_facts(folder)
    if table["status"] != COMPLETED:
        raise _incomplete(folder, table)
    facts = facts_from_table(table, where=str(folder / RUN_FILE))
    metrics = read_json(folder / METRICS_FILE)
    if not isinstance(metrics, dict):
        raise _damaged(folder / METRICS_FILE, type(metrics).__name__, "a table of metrics")
    surface = read_ground(folder, facts.terrain)
    view = View(read_recording(folder, RESULTS), facts.parameters, facts.gait_period, surface)
    checked = metrics.pop(ACCURACY, None)
    metrics.pop(WARNINGS, None)  # also in run.json
    accuracy = None if checked is None else accuracy_from_table(checked)
    return StoredResult(view, metrics, facts, read_scenario(folder), accuracy)


def _incomplete(folder: Path, facts: Mapping[str, Any]) -> HexapodError:
    """Returns the error for a run that goes on, failed, or was interrupted or killed."""
    status, reason = facts["status"], facts.get("reason")
    if status == RUNNING:
        got = "running: it goes on, or its process was killed"
    else:
        got = f"{status}: {reason}" if reason not in (None, "", status) else status
    recorded = sorted(path.name for path in folder.glob(f"{PARTIAL}.*"))
    rest = f"; what was recorded until then is in {' and '.join(recorded)}" if recorded else ""
    return HexapodError(
        "the run did not complete",
        got=got,
        expected="a completed run",
        fix=f"run it again{rest}",
        where=str(folder),
    )


@contextmanager
def damage_reported(folder: Path) -> Iterator[None]:
    """Raises HexapodError for any exception inside: of the system, or due to damaged results."""
    try:
        yield
    except (HexapodError, MemoryError):
        raise
    except OSError as error:
        raise HexapodError(
            "the results cannot be read or written",
            got=error.strerror or str(error),
            expected="files and folders that can be",
            fix="check the place, its rights and the room on the disk",
            where=str(error.filename or folder),
        ) from error
    except Exception as error:  # facts of wrong types fail anywhere in a report
        got = why_unreadable(error, "result of a run")
        raise _damaged(folder, got, "results as `hexapod` wrote them") from error


def read_facts(folder: Path) -> Mapping[str, Any]:
    """Reads run.json, which has the key "status" at least.

    Raises HexapodError when it is missing, damaged or no such file.
    """
    facts = read_json(folder / RUN_FILE)
    if not isinstance(facts, dict) or not isinstance(facts.get("status"), str):
        raise _damaged(folder / RUN_FILE, "no status", 'a table with "status"')
    return facts


def read_scenario(folder: Path) -> str:
    """Reads the TOML text of the scenario of a run or a comparison. Raises HexapodError."""
    try:
        return read_text(folder / SCENARIO)
    except (OSError, UnicodeDecodeError) as error:
        got = why_unreadable(error, "text")
        raise _damaged(folder / SCENARIO, got, "the scenario that was run") from error


def _damaged(path: Path, got: str, expected: str) -> HexapodError:
    return HexapodError(
        "damaged or foreign results",
        got=got,
        expected=expected,
        fix="run the scenario again",
        where=str(path),
    )


def stored_result(result: Result) -> StoredResult:
    """Returns what `read_result` would read after the run is written."""
    facts, recording = result.facts, result.outcome.recording
    surface = None if result.surface is None else around_walk(result.surface, recording)
    return StoredResult(
        View(recording, facts.parameters, facts.gait_period, surface),
        result.metrics,
        facts,
        tomlkit.dumps(result.scenario.to_table()),
    )


def write_accuracy(folder: Path, accuracy: Mapping[str, Any]) -> None:
    """Adds the table of an accuracy check to a folder's metrics. Raises HexapodError."""
    write_json(folder / METRICS_FILE, {**read_json(folder / METRICS_FILE), ACCURACY: accuracy})


def read_accuracies(folder: Path) -> dict[str, Accuracy]:
    """Reads the accuracies of a comparison's folder, by control; {} where none was checked.

    Raises HexapodError.
    """
    checked = read_json(folder / METRICS_FILE).get(ACCURACY, {})
    return {control: accuracy_from_table(item) for control, item in checked.items()}
