"""--check-accuracy of `hexapod simulate` and `compare`: walks once more, twice, and says what
that changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.cli.terminal import Count, counting_bar, show_table, show_text, warn
from hexapod_cosim.cosim.report.accuracy import Metrics, Rows, about_accuracy, effect_rows
from hexapod_cosim.cosim.results.accuracy import Accuracy, finer, halved, judge_accuracy
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.records import Scenario

CheckAccuracy = Annotated[
    bool,
    typer.Option(
        "--check-accuracy",
        help="Walk again at a hundredth of the solver's tolerance, and again with half the macro-step: an error beside every metric.",
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
    """Of the runs that these plans came to on an engine, all of one control, whose results are in a
    folder already.

    used: the gains of the runs. given: those that the user gave, which half the macro-step keeps;
    else it has gains of its own.
    """
    fine, half = [finer(plan) for plan in plans], [halved(plan) for plan in plans]
    try:
        with counting_bar("accuracy", len(fine) + len(half)) as tell:
            references = list(_run(fine, fmu=fmu, gains=used, engine=engine, tell=tell, done=0))
            halves = list(
                _run(half, fmu=fmu, gains=given, engine=engine, tell=tell, done=len(fine))
            )
    except KeyboardInterrupt:
        warn(
            f"the results in {folder} are whole, their accuracy was not checked; `hexapod report {folder}` draws their figures"
        )
        raise
    found = judge_accuracy(plans[0], runs, references, halves)
    for text in found.notes:
        warn(f"accuracy: {text}")
    return found


def _run(
    plans: Sequence[Scenario],
    *,
    fmu: Path | None,
    gains: Gains | None,
    engine: str,
    tell: Count,
    done: int,
) -> Iterator[Summary]:
    with closing(run_batch(plans, fmu=fmu, gains=gains, compiled=engine == "compiled")) as batch:
        tell(done)
        for count, summary in enumerate(batch, start=done + 1):
            tell(count)
            yield summary


def show_accuracy(rows: Rows, accuracies: Mapping[str, Accuracy], metrics: Metrics) -> None:
    """Prints what the errors in the main table are, whose rows are given, and what half the
    macro-step changes, by control.
    """
    if not accuracies:
        return
    show_text(about_accuracy(accuracies))
    texts = [
        [row["name"], row["unit"], *row["values"]] for row in effect_rows(rows, accuracies, metrics)
    ]
    show_table(["metric", "unit", *accuracies], texts, right=range(2, 2 + len(accuracies)))
