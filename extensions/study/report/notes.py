"""Notes on the limits of a study's results, for its report and the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.extensions.study.records import SOBOL, Study
from hexapod_cosim.extensions.study.report.tables import ending
from hexapod_cosim.extensions.study.summary import Results

TOO_SHORT = (
    "too short for figures, which are of whole gait cycles after the second: set a longer duration."
)


def notes(results: Results) -> list[str]:
    """Returns the notes as sentences."""
    found = [*_of_design(results.study), *_of_missing_runs(results)]
    found += [*_without_walks(results), *_of_walks(results)]
    for control, unbalanced in results.unbalanced.items():
        found += unbalanced.warnings(control, runs=results.overall.runs[control])
    return found


def _of_design(study: Study) -> Iterator[str]:
    if study.design == SOBOL and study.optimise is None and study.points & (study.points - 1):
        below = 1 << (study.points.bit_length() - 1)
        yield (
            f"{study.points} Sobol points are no power of two: only {below} or {2 * below} would "
            "cover the factors evenly."
        )


def _of_missing_runs(results: Results) -> Iterator[str]:
    if results.facts["status"] != COMPLETED and results.study.optimise is None:
        yield (
            "Not all runs are there. Means by control are of the runs that are there, which need "
            "not be of the same points and seeds; changes are of whole pairs."
        )


def _without_walks(results: Results) -> Iterator[str]:
    """Yields a note for each control under which no run walked to its end."""
    overall = results.overall
    for control, total in overall.runs.items():
        reasons = [(key, count) for key, count in results.failures.items() if key[0] == control]
        if reasons and not overall.walked[control]:
            (_, status, reason), count = reasons[0]
            alike = "all" if len(reasons) == 1 else f"{count} of them"
            yield (
                f"none of {total} {control} runs walked to its end; "
                f"{alike} {ending(status)}: {reason}"
            )


def _of_walks(results: Results) -> Iterator[str]:
    """Yields a note for each scenario and control whose walks gave no figures."""
    for (case, control), (walked, figured) in results.walks.items():
        if not figured:
            yield f"All {walked} {control} walks of {case} are {TOO_SHORT}"
