"""Reads what a study varies: its factors, or the variables and the goal of its optimisation.

A factor is a list of values, or a table with one of KINDS and its numbers; README.md has examples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtri

from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.extensions.study.records import (
    INTEGERS,
    LOGUNIFORM,
    NORMAL,
    SCENARIO_FACTOR,
    UNIFORM,
    VALUES,
    WALKED,
    Bound,
    Evaluation,
    Factor,
    Optimise,
    Value,
)
from hexapod_cosim.extensions.study.rules import (
    REQUIRED,
    Rules,
    count,
    is_number,
    named_once,
    number,
    read_table,
    require,
    seeds,
    texts,
)
from hexapod_cosim.models.schema import Choice, Flag, Text, expect_table

LARGEST = 1e100  # of the numbers of a factor: no sum or quotient of them overflows
LARGEST_INTEGER = 2**53  # a double represents all integers up to it
MAX_VALUES = 1_000_000
LEAST_BATCH = 5  # the least population of differential evolution
LEAST_QUANTILE = 2.0**-53  # a normal distribution has no value at quantile 0
# metrics of which less or more is better
OBJECTIVES = tuple(name for name, (_, less, _) in METRICS.items() if less is not None)
EXAMPLE = '"friction.mu" = { uniform = [0.3, 0.9] }'
# of the two numbers of a distribution: what must hold, in words and as a function
ENDS: Mapping[str, tuple[str, Callable[[float, float], bool]]] = {
    UNIFORM: ("the lower end first", lambda low, high: low <= high),
    LOGUNIFORM: ("ends > 0, the lower end first", lambda low, high: 0.0 < low <= high),
    NORMAL: ("a standard deviation >= 0", lambda _, deviation: deviation >= 0.0),
    INTEGERS: (
        "whole numbers within 53 bits, the lower end first",
        lambda low, high: (
            low <= high and low % 1 == high % 1 == 0 and max(-low, high) <= LARGEST_INTEGER
        ),
    ),
}


def read_factors(table: Any, where: str) -> tuple[Factor, ...]:
    """Reads the factors of a table. Raises StudyError.

    Names with dots may be written in quotes or as nested tables.
    """
    named = named_once(expect_table(table, where), where, _is_section)
    return tuple(_read_factor(*item) for item in named)


def _is_section(key: str, value: Any) -> bool:
    """Returns whether a value holds factors: TOML reads friction.mu as nested tables."""
    return (
        "." not in key
        and isinstance(value, Mapping)
        and bool(value)
        and all(isinstance(x, Mapping | list) and name not in KINDS for name, x in value.items())
    )


def _read_factor(name: str, value: Any, where: str) -> Factor:
    given = {VALUES: value} if isinstance(value, list) else value
    expected, fix = "a list of values or a distribution", f"write {EXAMPLE}"
    require(isinstance(given, Mapping), given, expected, where, fix=fix)
    read = read_table(given, FACTOR, where)
    made = [read[kind] for kind in KINDS if kind in given]
    require(len(made) == 1, dict(given), f"one of {', '.join(KINDS)}", where, fix=fix)
    return Factor(name=name, unit=read["unit"], relative=read["relative"], **made[0])


def _distribution(kind: str, given: Any, where: str) -> dict[str, Any]:
    """Returns the kind and the ends of a distribution, as keywords of Factor."""
    low, high = _numbers(given, 2, where)
    expected, holds = ENDS[kind]
    require(holds(low, high), given, expected, where)
    return {"kind": kind, "low": low, "high": high}


def _spaced(space: Callable[..., Any], given: Any, where: str) -> dict[str, Any]:
    """Returns the values of a linspace or a logspace, as keywords of Factor."""
    low, high, size = _numbers(given, 3, where)
    counted = size % 1 == 0 and 1 <= size <= MAX_VALUES
    require(counted, given, f"a whole number of 1 to {MAX_VALUES} values", where)
    positive = space is np.linspace or min(low, high) > 0.0
    require(positive, given, "ends > 0", where)
    return {"kind": VALUES, "values": tuple(space(low, high, int(size)).tolist())}


def _values(given: Any, where: str) -> dict[str, Any]:
    typed = isinstance(given, list) and all(isinstance(item, int | float | str) for item in given)
    expected, fix = "a list of numbers, names or booleans", "write values = [0.3, 0.6]"
    require(typed and len(given) > 0, given, expected, where, fix=fix)
    kinds = {bool: "booleans", str: "texts"}
    alike = len({kinds.get(type(item), "numbers") for item in given}) == 1
    require(alike, given, "values of one kind: numbers, texts or booleans", where)
    return {"kind": VALUES, "values": tuple(given)}


def _numbers(given: Any, size: int, where: str) -> list[float]:
    listed = isinstance(given, list) and len(given) == size and all(map(is_number, given))
    small = listed and all(abs(item) <= LARGEST for item in given)
    expected = f"{size} finite numbers of at most {LARGEST:g}"
    require(small, given, expected, where, fix=f"write {EXAMPLE}")
    return [float(item) for item in given]


_KINDS: Rules = {
    VALUES: (_values, None),
    "linspace": (partial(_spaced, np.linspace), None),
    "logspace": (partial(_spaced, np.geomspace), None),
    **{kind: (partial(_distribution, kind), None) for kind in ENDS},
}
KINDS = tuple(_KINDS)
FACTOR: Rules = {**_KINDS, "unit": (Text().read, ""), "relative": (Flag().read, False)}


def read_optimise(table: Any, where: str) -> tuple[Optimise, tuple[Factor, ...]]:
    """Returns the optimisation and its variables, which are settings or gains with bounds."""
    read = read_table(table, OPTIMISE, where)
    variables, place = read.pop("variables"), f"{where}.variables"
    given = [factor.name for factor in variables]
    some = len(given) > 0 and SCENARIO_FACTOR not in given
    require(some, given, "settings or gains", place, what="not variables")
    bounded = all(factor.kind != NORMAL for factor in variables)
    expected = "values, uniform, loguniform or integers"
    require(bounded, NORMAL, expected, place, what="a variable without bounds")
    _check_held_out(read["training"], read["held_out"], f"{where}.held_out")
    batch = max(read.pop("batch"), LEAST_BATCH)
    trials = batch * math.ceil(read.pop("trials") / batch)
    return Optimise(trials=trials, batch=batch, **read), variables


def _evaluation(table: Any, where: str) -> Evaluation:
    read = read_table(table, EVALUATION, where)
    return Evaluation(cases=tuple(read["scenarios"]), seeds=read["seeds"])


def _check_held_out(training: Evaluation, held_out: Evaluation, where: str) -> None:
    """Raises StudyError for a held-out scenario or seed that is one of training.

    A seed draws the same changes in every scenario.
    """
    for key, one, other in (
        ("scenarios", training.cases, held_out.cases),
        ("seeds", training.seeds, held_out.seeds),
    ):
        common: Any = sorted(set(one) & set(other))
        what, expected = f"held-out {key} that are trained on", f"{key} that training does not use"
        require(not common, common, expected, f"{where}.{key}", what=what, fix="name others")


def _bounds(table: Any, where: str) -> tuple[Bound, ...]:
    """Returns the constraints, of which the first is that every run walks to its end."""
    given = read_table(table, dict.fromkeys(OBJECTIVES, (_bound, None)), where)
    limits = {name: bound for name, bound in given.items() if bound is not None}
    return EVERY_RUN, *(Bound(metric=name, **bound) for name, bound in limits.items())


def _bound(table: Any, where: str) -> dict[str, float]:
    ends = {"at_least": (number, -math.inf), "at_most": (number, math.inf)}
    return read_table(table, ends, where)


EVERY_RUN = Bound(metric=WALKED, at_least=1.0)
EVALUATION: Rules = {"scenarios": (texts, REQUIRED), "seeds": (seeds, range(1))}
OPTIMISE: Rules = {
    "metric": (Choice(OBJECTIVES).read, REQUIRED),
    "constraints": (_bounds, (EVERY_RUN,)),
    "trials": (count, 50),
    "batch": (count, LEAST_BATCH),
    "control": (Text().read, COMPARED[-1]),
    "variables": (read_factors, REQUIRED),
    "training": (_evaluation, REQUIRED),
    "held_out": (_evaluation, REQUIRED),
}


def at_quantile(factor: Factor, share: float) -> Value:
    """Returns the value at a quantile, 0 to 1, of the factor's distribution.

    All values of a list are equally likely.
    """
    low, high = factor.low, factor.high
    if factor.kind == VALUES:
        return factor.values[min(int(share * len(factor.values)), len(factor.values) - 1)]
    if factor.kind == INTEGERS:
        return int(min(low + math.floor(share * (high - low + 1.0)), high))
    if factor.kind == LOGUNIFORM:
        return float(min(low * (high / low) ** share, high))
    if factor.kind == NORMAL:
        return float(low + high * ndtri(min(max(share, LEAST_QUANTILE), 1.0 - LEAST_QUANTILE)))
    return low + (high - low) * share


def samples(factor: Factor) -> tuple[Value, ...]:
    """Returns values by which the factor's name, unit and range can be checked.

    They are all values of a list, and the ends of a distribution. For a normal distribution they
    are the mean and values one standard deviation away; a value further out is checked when it is
    run.
    """
    if factor.kind == VALUES:
        return factor.values
    if factor.kind == NORMAL:
        return factor.low, factor.low - factor.high, factor.low + factor.high
    return at_quantile(factor, 0.0), at_quantile(factor, 1.0)
