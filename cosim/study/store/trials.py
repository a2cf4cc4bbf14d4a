"""The trials of an optimisation, computed from its training runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hexapod_cosim.cosim.study.plan.objective import WALKED
from hexapod_cosim.cosim.study.plan.optimisation import Optimisation
from hexapod_cosim.cosim.study.plan.records import Optimise, Value
from hexapod_cosim.cosim.study.store.table import Point

OPTIMUM = "optimum.json"


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The settings of a trial and its results on the training runs."""

    number: int
    values: tuple[Value, ...]
    means: Mapping[str, float]  # by metric of the objectives and constraints
    feasible: bool


def feasible(means: Mapping[str, float], asked: Optimise) -> bool:
    """Returns whether the means meet all constraints."""
    return all(bound.excess(means[bound.metric]) <= 0.0 for bound in asked.constraints)


def trials_of(plan: Optimisation, points: Sequence[Point]) -> list[Trial]:
    """Returns the trials of which all training runs are stored, from the points of the study."""
    found = []
    for point in points:
        if (
            point.held_out
            or point.number >= plan.asked.trials
            or point.runs[plan.asked.control] < plan.asked.training.runs
        ):
            continue
        share = point.walked[plan.asked.control] / point.runs[plan.asked.control]
        means = {
            name: item.value if share == 1.0 else math.nan
            for name, item in point.means[plan.asked.control].items()
        }
        means[WALKED] = share
        values = tuple(point.values[factor.name] for factor in plan.study.factors)
        found.append(
            Trial(
                number=point.number,
                values=values,
                means=means,
                feasible=feasible(means, plan.asked),
            )
        )
    return found
