"""Compares runs under any number of controls, seed by seed, each control with its reference.

The reference is the first control; of a control in another walk it is the first control in that
walk (`reference_of`). Each pair makes a `Comparison`, whose changes use the pairs of runs in which
both robots walked upright to the end and arrived.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import (
    PARTS,
    RUN_FILE,
    atomic_text,
    why_unreadable,
    write_json,
    write_text,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import Comparison, compare_runs, judged_pairs
from hexapod_cosim.cosim.results.folder import METRICS_FILE, SCENARIO
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import (
    Summary,
    balance_warnings,
    described_losses,
    finite_mean,
)
from hexapod_cosim.cosim.scenario.controls import AT, reference_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError

WALKS = "walks"  # key of run.json
SEEDS = "seeds.csv"
FACTS = tuple(item.name for item in fields(Summary) if item.name != "metrics")
SEPARATOR = " | "  # between the warnings of a run in one cell


@dataclass(frozen=True)
class Comparisons:
    """Runs of the same seeds under two or more controls, by label; the first is the reference."""

    runs: Mapping[str, tuple[Summary, ...]]
    pairs: tuple[Comparison, ...]  # each but the first control with its reference, in their order

    @property
    def labels(self) -> tuple[str, ...]:
        """Returns the labels of the controls."""
        return tuple(self.runs)

    @property
    def reference(self) -> str:
        """The first control, with which those in its walk are compared."""
        return self.labels[0]

    @property
    def main(self) -> Comparison:
        """The comparison of the last control that is in the walk of the first one."""
        walks = [label.partition(AT)[2] for label in self.labels]
        same = [pair for pair, walk in zip(self.pairs, walks[1:], strict=True) if walk == walks[0]]
        return (same or self.pairs)[-1]

    @property
    def seeds(self) -> list[int]:
        """The seeds of the runs."""
        return [run.seed for run in self.runs[self.reference]]

    @property
    def walked(self) -> dict[str, int]:
        """Number of runs, by control, in which the robot walked upright to the end and arrived."""
        return {label: sum(run.success for run in runs) for label, runs in self.runs.items()}

    @property
    def judged(self) -> dict[str, list[Summary]]:
        """The runs that the means are of, by control.

        With two controls these are the pairs in which both walked; with more, each control's runs
        that walked, or all where none did.
        """
        if len(self.pairs) == 1:
            pairs = judged_pairs(self.pairs[0].first, self.pairs[0].second)
            return dict(zip(self.labels, map(list, zip(*pairs, strict=True)), strict=True))
        return {
            label: [run for run in runs if run.success] or list(runs)
            for label, runs in self.runs.items()
        }

    @property
    def means(self) -> dict[str, dict[str, float]]:
        """Mean of each metric, by control and metric."""
        return {
            label: {name: finite_mean([run.metrics[name] for run in runs]) for name in METRICS}
            for label, runs in self.judged.items()
        }

    @property
    def losses(self) -> list[str]:
        """Describes the runs in which the robot did not walk to the end or did not arrive."""
        return described_losses(chain.from_iterable(self.runs.values()))

    @property
    def unbalanced(self) -> list[str]:
        """Warns, in one line per control, of runs whose energy balance does not close."""
        return [
            text
            for label, runs in self.runs.items()
            for text in balance_warnings(
                label, [run.metrics["energy_residual"] for run in runs], runs=len(runs)
            )
        ]

    @property
    def warnings(self) -> list[str]:
        """Describes the falls and the energy balances that do not close, over all seeds."""
        return [*self.losses, *self.unbalanced]

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON: means, changes, numbers of seeds and walks, warnings.

        With two controls the changes are under `change`, with more under `changes` by label.
        """
        changes = {
            pair.labels[1]: {name: item.as_table() for name, item in pair.changes.items()}
            for pair in self.pairs
        }
        compared: dict[str, Any] = {
            "reference": self.reference,
            "references": {pair.labels[1]: pair.labels[0] for pair in self.pairs},
            "changes": changes,
        }
        if len(self.pairs) == 1:
            compared = {"change": changes[self.labels[1]]}
        counts = {"seeds": len(self.seeds), "walked": self.walked}
        return {**self.means, **compared, **counts, "warnings": self.warnings}


def compare_all(runs: Mapping[str, Sequence[Summary]]) -> Comparisons:
    """Compares the runs of each control with those of its reference.

    Raises HexapodError when their seeds differ.
    """
    labels = list(runs)
    pairs = tuple(
        compare_runs(runs[reference_of(label, labels)], runs[label]) for label in labels[1:]
    )
    return Comparisons({label: tuple(some) for label, some in runs.items()}, pairs)


def write_comparison(
    folder: Path,
    scenario: Scenario,
    comparison: Comparisons,
    *,
    labels: Sequence[str],
    command: str = "",
    walks: Sequence[str] = (),
) -> list[Path]:
    """Writes scenario.toml, metrics.json and run.json of a comparison; returns the files.

    The scenario has no control, since several were run; the parameters of [control] stay.

    Args:
        labels: of the controls that have recordings.
        command: that makes the comparison.
        walks: a sentence on the gait and stance of each control, where they differ.
    """
    table = {key: value for key, value in scenario.to_table().items() if key != "control"}
    if scenario.control_settings:
        table["control"] = dict(scenario.control_settings)
    write_text(folder / SCENARIO, tomlkit.dumps(table))
    write_json(folder / METRICS_FILE, comparison.as_table())
    facts = {"kind": "compare", "status": COMPLETED, "title": scenario.title, "command": command}
    write_json(folder / RUN_FILE, {**facts, PARTS: list(labels), WALKS: list(walks)})
    return [folder / name for name in (SCENARIO, METRICS_FILE, RUN_FILE)]


def write_seeds(path: Path, runs: Sequence[Summary]) -> None:
    """Writes seeds.csv, one line per run with its facts and metrics. The file is never partial."""
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*FACTS, *METRICS])
        for run in runs:
            facts = [_cell(getattr(run, name)) for name in FACTS]
            writer.writerow([*facts, *(_cell(run.metrics[name]) for name in METRICS)])


def _cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return SEPARATOR.join(value)
    return "" if isinstance(value, float) and math.isnan(value) else value


def read_seeds(path: Path) -> dict[str, list[Summary]]:
    """Reads the runs of seeds.csv, by control. Raises HexapodError for a damaged file."""
    runs: dict[str, list[Summary]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                runs.setdefault(row["control"], []).append(_summary(row))
    except (OSError, KeyError, TypeError, ValueError, csv.Error) as error:
        raise HexapodError(
            "no runs by seed" if isinstance(error, OSError) else "damaged file",
            got=why_unreadable(error, "table of runs"),
            expected=f"{SEEDS} of a comparison, with a line per run and all metrics",
            fix="run `hexapod compare` again",
            where=str(path),
        ) from error
    return runs


def _summary(row: Mapping[str, str]) -> Summary:
    return Summary(
        control=row["control"],
        seed=int(row["seed"]),
        status=row["status"],
        reason=row["reason"],
        upright=row["upright"] == str(True),
        fallback=_number(row["fallback"]) if row["fallback"] else None,
        warnings=tuple(filter(None, row["warnings"].split(SEPARATOR))),
        missed=row["missed"],
        metrics={name: _number(row[name]) for name in METRICS},
    )


def _number(text: str) -> float:
    return float(text) if text else math.nan
