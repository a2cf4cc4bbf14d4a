"""Runs the walks of the results; each walk is run once."""

from __future__ import annotations

import atexit
from collections.abc import Callable, Iterable, Sequence
from functools import cache

import numpy as np

from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import View, Walk
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.cosim.scenario.scenario import load_scenario

MILLI = 1e3


@cache
def walker() -> Walker:
    """Returns the walker of all results, which records all signals."""
    made = Walker(everything=True)
    atexit.register(made.close)
    return made


@cache
def walk(*settings: str, scenario: str = "walk_flat") -> Result:
    """Runs a shipped scenario, by default the judged walk, with some settings."""
    plan = load_scenario(scenario, overrides=settings)
    return walker().simulate(plan)


def under_both(*settings: str, scenario: str = "walk_flat") -> tuple[Result, Result]:
    """Runs it under both controls, kinematic first. Raises RuntimeError unless both walk."""
    first, second = (walk(f"control={name}", *settings, scenario=scenario) for name in COMPARED)
    for result in (first, second):
        if not (result.completed and result.facts.walk.upright):
            raise RuntimeError(f"{scenario} {settings}: {result.outcome.reason or 'fell'}")
    return first, second


def view(result: Result) -> View:
    """Returns the macro-steps of a run from which its metrics are computed."""
    return View(result.outcome.judged, result.parameters, result.facts.gait_period)


def judged(result: Result) -> Walk:
    """Returns the judged part of a run."""
    part = view(result).walk
    assert part is not None
    return part


def heading(name: str) -> str:
    """Returns a metric's name with its unit."""
    unit = METRICS[name][0]
    return f"`{name}`" + (f" [{unit}]" if unit != "1" else "")


def figures(name: str, results: Sequence[Result]) -> list[str]:
    """Formats a metric of several runs."""
    return [shown(result.metrics[name]) for result in results]


def shown(value: float) -> str:
    """Formats a value with three digits."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:#.3g}"


def changed(values: Iterable[float], *, form: Callable[[float], str] = shown) -> str:
    """Formats a figure under kinematic and under compliant control in one line."""
    return "\u00a0→\u00a0".join(map(form, values)).replace("-", "\u2011")
