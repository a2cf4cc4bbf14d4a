"""Option --check-accuracy of `hexapod simulate` and `compare`: two more runs of each walk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.cli.terminal import Count, counting_bar, show_table, show_text, warn
from hexapod_cosim.cosim.report.accuracy import Metrics, Rows, about_accuracy, effect_rows
from hexapod_cosim.cosim.results.accuracy import (
    Accuracy,
    compare_accuracy,
    halved_scenario,
    reference_scenario,
)
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.records import Scenario

CheckAccuracy = Annotated[
    bool,
    typer.Option(
        "--check-accuracy",
        help=(
            "Walk again at a hundredth of the solver's tolerance, "
            "and again with half the macro-step: an error beside every metric."
        ),
    ),
]


def check_accuracy(
    plans: Sequence[Scenario],
    runs: Sequence[Summary],
    folder: Path,
    *,
    fmu: Path | None,
    used: Gains | None,
    given: Gains | None,
    engine: str,
) -> Accuracy:
    """Returns the accuracy of runs of one control, whose results are in a folder already.

    Args:
        plans: the scenarios of the runs.
        runs: their summaries.
        folder: where their results are, for the message after an interrupt.
        fmu: the plant; None: exported for the robot.
        used: the gains of the runs.
        engine: the engine of the runs, which runs them again.
        given: the user's gains, which half the macro-step keeps; without them it designs its own.
    """
    fine = [reference_scenario(plan) for plan in plans]
    half = [halved_scenario(plan) for plan in plans]
    try:
        with counting_bar("accuracy", len(fine) + len(half)) as report_count:
            references = list(
                _run(fine, fmu=fmu, gains=used, engine=engine, report_count=report_count, done=0)
            )
            halves = list(
                _run(
                    half,
                    fmu=fmu,
                    gains=given,
                    engine=engine,
                    report_count=report_count,
                    done=len(fine),
                )
            )
    except KeyboardInterrupt:
        warn(
            f"the results in {folder} are complete, their accuracy was not checked; "
            f"`hexapod report {folder}` draws their figures"
        )
        raise
    found = compare_accuracy(plans[0], runs, references, halves)
    for text in found.notes:
        warn(f"accuracy: {text}")
    return found


def _run(
    plans: Sequence[Scenario],
    *,
    fmu: Path | None,
    gains: Gains | None,
    engine: str,
    report_count: Count,
    done: int,
) -> Iterator[Summary]:
    """Runs the plans; `done` is the number of runs before them."""
    with closing(run_batch(plans, fmu=fmu, gains=gains, compiled=engine == "compiled")) as batch:
        report_count(done)
        for count, summary in enumerate(batch, start=done + 1):
            report_count(count)
            yield summary


def show_accuracy(rows: Rows, accuracies: Mapping[str, Accuracy], metrics: Metrics) -> None:
    """Prints an explanation of the errors in the main table and the effects of half the macro-step.

    rows: those of the main table; accuracies, metrics: by control.
    """
    if not accuracies:
        return
    show_text(about_accuracy(accuracies))
    texts = [
        [row["name"], row["unit"], *row["values"]] for row in effect_rows(rows, accuracies, metrics)
    ]
    show_table(["metric", "unit", *accuracies], texts, right=range(2, 2 + len(accuracies)))
