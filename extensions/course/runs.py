"""Runs the course: every case under every control at every seed, in worker processes."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.results.locomotion import missed_end
from hexapod_cosim.cosim.results.summary import UNBALANCED, Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.controls import Control
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.extensions.course.records import QUANTITIES, Case, Course, run_scenario


@dataclass(frozen=True)
class Run:
    """A run of the course."""

    case: str
    control: str
    seed: int
    failure: str  # why it is no success, "" for a success
    values: Mapping[str, float]  # by the quantity's name; NaN where undefined

    @property
    def success(self) -> bool:
        """Whether the robot walked upright to the end and arrived."""
        return not self.failure


def run_course(
    course: Course,
    controls: Sequence[Control],
    *,
    gains: Gains | None = None,
    workers: int | None = None,
) -> Generator[Run, None, None]:
    """Runs the cases one after the other and yields the runs, seed by seed, control by control.

    The runs do not depend on `workers`. Close the iterator where the loop over it may be left
    early.
    """
    orders = list(_orders(course, controls))
    scenarios = [scenario for _, _, scenario in orders]
    batch = run_batch(scenarios, gains=gains, workers=workers, compiled=True)
    with closing(batch) as summaries:
        for (case, control, _), summary in zip(orders, summaries, strict=True):
            yield judged(case, control, summary, arrive=course.arrive)


def _orders(
    course: Course, controls: Sequence[Control]
) -> Iterator[tuple[Case, Control, Scenario]]:
    """Yields case, control and scenario of each run."""
    for case in course.cases:
        for seed in course.seeds:
            for control in controls:
                yield case, control, run_scenario(case, control=control, seed=seed)


def judged(case: Case, control: Control, summary: Summary, *, arrive: float) -> Run:
    """Returns the run of a summary: a success, or a failure with its reason.

    arrive: largest path error [m/m], or yaw drift [rad/rad] of a turn on the spot, of a success.
    """
    values = {quantity.name: quantity.value(summary.metrics) for quantity in QUANTITIES}
    return Run(
        case=case.name,
        control=control.label,
        seed=summary.seed,
        failure=failure_of(summary, arrive=arrive),
        values=values,
    )


def failure_of(summary: Summary, *, arrive: float) -> str:
    """Returns why a run is no success; "" for a success."""
    if not summary.walked:
        return summary.reason or "; ".join(summary.warnings[:1]) or "the robot fell"
    if summary.metrics["energy_residual"] > UNBALANCED:
        return f"not valid: the energy balance misses over {100.0 * UNBALANCED:g} % of the work"
    return missed_end(summary.metrics, arrive=arrive)


def run_count(course: Course, controls: Sequence[Control]) -> int:
    """Returns the number of runs of a course."""
    return len(course.cases) * len(course.seeds) * len(controls)
