"""Runs an optimisation: trials of settings on training runs, then the best one on held-out runs.

The search is SciPy's differential evolution over the quantiles of the variables, so values of all
kinds are alike to it. It is seeded and evaluates a batch of trials at a time, so equal results lead
to equal trials: a study that is resumed begins with the first trial again, and finds the results in
the store. Held-out runs are numbered after all training runs, and made from scenarios and seeds
that the search does not use.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.dispatch import ResultSink, Workers, dispatch
from hexapod_cosim.extensions.study.factors import at_quantile
from hexapod_cosim.extensions.study.folder import OPTIMUM
from hexapod_cosim.extensions.study.orders import STREAM, trial_orders
from hexapod_cosim.extensions.study.records import WALKED, Optimise, Order, Study
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.summary import Runs
from hexapod_cosim.models.arrays import Array

WORST = 1e9  # cost of a trial that breaks a constraint, to which its excess is added
Trial = dict[str, Any]  # number, values by variable, means by metric, whether it is feasible, cost


def optimise(study: Study, sink: ResultSink, workers: Workers, folder: Path) -> None:
    """Runs all trials, then the held-out runs of the best one, and writes optimum.json."""
    asked, unset = study.optimise, (None,) * len(study.factors)
    assert asked is not None
    trials, last = list[Trial](), asked.trials

    def run(orders: Sequence[Order]) -> Runs:
        """Runs those of some orders that are not stored; returns all stored runs."""
        done = sink.store.done(asked.count)
        missing = [order for order in orders if not done[order.run]]
        dispatch(sink, workers, missing, len(missing))
        return Runs(study, sink.store)

    def costs(shares: Array) -> Array:
        """Runs trials at the quantiles (factors, batch) and returns their costs (batch,)."""
        values = [tuple(map(at_quantile, study.factors, point)) for point in shares.T.tolist()]
        numbers = range(len(trials), len(trials) + len(values))
        orders = [trial_orders(study, *pair) for pair in zip(numbers, values, strict=True)]
        runs = run([order for part in orders for order in part])
        for number, item in zip(numbers, values, strict=True):
            trials.append(_trial(runs, number, item, asked))
        return np.array([trials[number]["cost"] for number in numbers])

    _search(costs, study, asked)
    best = min(trials, key=lambda trial: float(trial["cost"]))
    chosen = tuple(best["values"].values())
    orders = trial_orders(study, last, unset) + trial_orders(study, last + 1, unset, held_out=True)
    runs = run(orders + trial_orders(study, last + 2, chosen, held_out=True))
    points = {"training": (last, best["number"]), "held_out": (last + 1, last + 2)}
    before, after = (
        {part: means_of(runs, pair[side], asked) for part, pair in points.items()}
        for side in (0, 1)
    )
    changes = {part: _changes(runs, pair, asked) for part, pair in points.items()}
    result = {"trials": trials, "before": before, "best": {**best, **after, "change": changes}}
    write_json(folder / OPTIMUM, result)


def _search(costs: Callable[[Array], Array], study: Study, asked: Optimise) -> None:
    """Minimises costs(shares), where shares (factors, batch) are in [0, 1]."""
    from scipy.optimize import differential_evolution  # noqa: PLC0415  slow to import
    from scipy.stats import qmc  # noqa: PLC0415

    size, seed = len(study.factors), np.random.default_rng([study.seed, STREAM])
    differential_evolution(
        costs,
        [(0.0, 1.0)] * size,
        init=qmc.LatinHypercube(size, seed=seed).random(asked.batch),
        maxiter=asked.trials // asked.batch - 1,
        tol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        seed=seed,
    )


def _trial(runs: Runs, number: int, values: tuple[Any, ...], asked: Optimise) -> Trial:
    """Returns a trial from its runs."""
    means = means_of(runs, number, asked)
    cost, feasible = _cost(means, asked)
    return {
        "number": number,
        "values": dict(zip((item.name for item in runs.study.factors), values, strict=True)),
        "means": means,
        "feasible": feasible,
        "cost": cost,
    }


def _cost(means: Mapping[str, float], asked: Optimise) -> tuple[float, bool]:
    """Returns what the search minimises, always finite, and whether all constraints are met."""
    excess = sum(max(bound.excess(means[bound.metric]), 0.0) for bound in asked.constraints)
    if excess > 0.0:
        return WORST + min(excess, WORST), False
    sign, value = 1.0 if METRICS[asked.metric][1] else -1.0, means[asked.metric]
    return sign * value if math.isfinite(value) else 2.0 * WORST, True


def means_of(runs: Runs, point: int, asked: Optimise) -> dict[str, float]:
    """Returns the means of the metrics of the objective and the constraints at a point, by name.

    A mean is over the walks that have the metric (a walk on the spot has no slip per metre). It
    is NaN when one of the runs did not walk to its end.
    """
    pairs = runs.of_point(point)
    walked = float(runs.walked[pairs].mean())
    names = [name for name in asked.metrics if name != WALKED]
    means = runs.figures(pairs, names).means[asked.control]
    values = {name: means[name].value if walked == 1.0 else math.nan for name in names}
    return {**values, WALKED: walked}


def _changes(runs: Runs, points: tuple[int, int], asked: Optimise) -> dict[str, Any]:
    """Returns the changes of metrics from one point to another, by name.

    They are computed as by `hexapod compare`, over pairs of runs of the same scenario, seed and
    control that both walked to the end.
    """
    before, after = (runs.values[runs.of_point(point), 0] for point in points)
    pairs = np.stack([before, after], axis=1)
    return {
        name: change_of(name, pairs[..., FIGURES.index(name)]).as_table()
        for name in asked.metrics
        if name != WALKED
    }
