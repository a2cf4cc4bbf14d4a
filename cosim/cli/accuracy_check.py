"""Option --check-accuracy of `hexapod simulate` and `compare`: two more runs of each walk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

from hexapod_cosim.cosim.cli.running import RunOptions
from hexapod_cosim.cosim.cli.terminal import Count, counting_bar, show_table, show_text, warn
from hexapod_cosim.cosim.report.tables import Metrics, Rows, about_accuracy, effect_rows
from hexapod_cosim.cosim.results.accuracy import (
    Accuracy,
    compare_accuracy,
    halved_scenario,
    reference_scenario,
)
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.records import Scenario


def check_accuracy(
    plans: Sequence[Scenario],
    runs: Sequence[Summary],
    folder: Path,
    options: RunOptions,
) -> Accuracy:
    """Returns the accuracy of runs of one control, whose results are in a folder already.

    Args:
        plans: the scenarios of the runs.
        runs: their summaries.
        folder: where their results are, for the message after an interrupt.
        options: those of the runs. Gains that are not given are designed for each macro-step.
    """
    fine = [reference_scenario(plan) for plan in plans]
    half = [halved_scenario(plan) for plan in plans]
    try:
        with counting_bar("accuracy", len(fine) + len(half)) as report_count:
            references = list(_run(fine, options, report_count, done=0))
            halves = list(_run(half, options, report_count, done=len(fine)))
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
    plans: Sequence[Scenario], options: RunOptions, report_count: Count, *, done: int
) -> Iterator[Summary]:
    """Runs the plans; `done` is the number of runs before them."""
    compiled = options.engine == "compiled"
    runs = run_batch(plans, fmu=options.fmu, gains=options.gains, compiled=compiled)
    with closing(runs) as batch:
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
