"""A run on disk: what is written when it completes, what when it does not, and how it is read again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.files import RUN_FILE, RUNNING, claim_folder, clear_folder, read_json, write_json, write_text
from hexapod_cosim.cosim.master import COMPLETED, FAILED, INTERRUPTED
from hexapod_cosim.cosim.metrics import View
from hexapod_cosim.cosim.recordings import COMMANDS, read_recording, write_commands, write_recording
from hexapod_cosim.cosim.run import Result
from hexapod_cosim.cosim.toml_text import to_toml
from hexapod_cosim.models import HexapodError

RESULTS, PARTIAL, METRICS_FILE, SCENARIO = "results", "results.partial", "metrics.json", "scenario.toml"
ABOUT = ("title", "control", "robot", "fmu", "versions")  # of the facts, in Parquet


@dataclass(frozen=True)
class Stored:
    """A completed run, as a report needs it."""

    view: View
    metrics: Mapping[str, float | None]
    facts: Mapping[str, Any]
    scenario: str  # TOML


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
    """A folder whose run.json says so when a run began and the block does not come to its end. Raises HexapodError when it cannot be."""
    made = claim_folder(path)
    folder = Folder(path)
    try:
        yield folder
    except BaseException as error:
        if folder.begun and read_json(path / RUN_FILE)["status"] == RUNNING:
            status, reason = (INTERRUPTED, "interrupted") if isinstance(error, KeyboardInterrupt) else (FAILED, str(error))
            write_json(path / RUN_FILE, {"status": status, "reason": reason})
        raise
    finally:
        for place in () if folder.begun else made:
            with suppress(OSError):  # not empty any more
                place.rmdir()


def write_result(result: Result, folder: Path) -> list[Path]:
    """Writes a run into a prepared folder; one that did not complete leaves `results.partial.*` and no figures. Returns the files, the
    scenario first and the recording next.
    """
    facts, outputs, scenario = run_facts(result), result.scenario.outputs, to_toml(result.scenario.to_table())
    whole = result.outcome.recording
    write_text(folder / SCENARIO, scenario)
    about = {key: facts[key] for key in ABOUT} | {"scenario": scenario}
    kept, stem = (whole.chosen(outputs.csv), RESULTS) if result.completed else (whole, PARTIAL)
    files = [folder / SCENARIO, *write_recording(kept, folder, stem, formats=outputs.formats, about=about)]
    if result.completed and "csv" in outputs.formats:
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
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        **result.facts,
        "parameters": dict(result.parameters),
    }


def read_result(folder: Path) -> Stored:
    """A completed run from its folder. Raises HexapodError when there is none, or it did not complete."""
    facts = read_json(folder / RUN_FILE)
    if facts.get("status") != COMPLETED:
        got = f"{facts.get('status')}: {facts.get('reason')}" if facts.get("reason") else facts.get("status")
        raise HexapodError("the run did not complete", got=got, expected="a completed run", fix="run it again", where=str(folder))
    view = View(read_recording(folder, RESULTS), facts["parameters"], facts["gait_period"])
    scenario = (folder / SCENARIO).read_text(encoding="utf-8")
    return Stored(view, read_json(folder / METRICS_FILE), facts, scenario)


def stored(result: Result) -> Stored:
    """The same, straight from a run."""
    facts = run_facts(result)
    return Stored(
        View(result.outcome.recording, result.parameters, facts["gait_period"]), result.metrics, facts, to_toml(result.scenario.to_table())
    )
