"""Notes on the limits of a study's results, for its report and the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.extensions.study.records import SOBOL, Study
from hexapod_cosim.extensions.study.summary import Results

NO_WALK = (
    "No run walked to its end, so there are no figures of walks. "
    "The reasons are listed under Failures."
)
TOO_SHORT = (
    "too short for figures, which are of whole gait cycles after the second: set a longer duration."
)


def notes(results: Results) -> list[str]:
    """Returns the notes as sentences."""
    found = [*_of_design(results.study), *_of_missing_runs(results), *_of_walks(results)]
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


def _of_walks(results: Results) -> Iterator[str]:
    """Yields notes where no run walked, or where the walks of a scenario gave no figures."""
    walks = results.walks
    if results.runs and not walks:
        yield NO_WALK
    elif walks and not any(figured for _, figured in walks.values()):
        yield f"The walks are {TOO_SHORT}"
    else:
        for (case, control), (walked, figured) in walks.items():
            if not figured:
                yield f"All {walked} {control} walks of {case} are {TOO_SHORT}"
