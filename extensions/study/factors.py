"""Reads what a study varies: its factors, or the variables and the goal of its optimisation.

A factor is a list of values or a distribution. Values, evenly spaced ones, and ones that are evenly
spaced in their logarithm:

    "friction.mu" = [0.3, 0.6]
    "friction.mu" = { linspace = [0.2, 1.0, 9] }
    "friction.mu" = { logspace = [0.2, 1.0, 9] }

Distributions; `normal` takes the mean and the standard deviation, `integers` the first and the
last integer:

    "torso.mass" = { uniform = [2.0, 4.0] }
    "torso.mass" = { loguniform = [2.0, 4.0] }
    "torso.mass" = { normal = [2.7, 0.1] }

A unit, and a factor of the designed gain:

    "terrain.incline" = { linspace = [0, 10, 6], unit = "deg" }
    "gains.hold.path_rate" = { loguniform = [0.3, 3.0], relative = true }
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
    SAMPLERS,
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
    Rule,
    Rules,
    boolean,
    is_number,
    leaves,
    names,
    optional,
    read_table,
    require,
    require_known,
    require_once,
    seeds,
    text,
    texts,
    whole,
)

SPACED: Mapping[str, Callable[..., Any]] = {
    "linspace": np.linspace,
    "logspace": np.geomspace,
}
LEAST, LARGEST = 1e-100, 1e100  # of ends: no quotient of them overflows
LARGEST_INTEGER = 2**53  # a double represents all integers up to it
MAX_VALUES = 1_000_000
PARAMETERS = "parameters."
LEAST_QUANTILE = 2.0**-53  # a normal distribution has no value at quantile 0
# metrics of which less or more is better
OBJECTIVES = tuple(name for name, (_, less, _) in METRICS.items() if less is not None)
EXAMPLE = '"friction.mu" = { uniform = [0.3, 0.9] }'
# of the two numbers of a distribution: what must hold, in words and as a function
ENDS: Mapping[str, tuple[str, Callable[[float, float], bool]]] = {
    UNIFORM: ("the lower end first", lambda low, high: low <= high),
    LOGUNIFORM: ("ends > 0, the lower end first", lambda low, high: LEAST <= low <= high),
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
    require(isinstance(table, Mapping), table, "a table of factors", where, fix=f"write {EXAMPLE}")
    found: dict[str, Factor] = {}  # by name in small letters: columns of SQL ignore case
    for name, value in leaves(table, is_section=_is_section):
        plain = plain_name(name)
        require_once(name, plain.lower() in found, f"{where}.{name}")
        found[plain.lower()] = _read_factor(plain, value, f"{where}.{name}")
    return tuple(found.values())


def plain_name(name: str) -> str:
    """Returns a setting's name without the prefix "parameters.", which is optional."""
    return name.removeprefix(PARAMETERS)


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


def _spaced(kind: str, given: Any, where: str) -> dict[str, Any]:
    """Returns the values of a linspace or a logspace, as keywords of Factor."""
    low, high, count = _numbers(given, 3, where)
    counted = count % 1 == 0 and 1 <= count <= MAX_VALUES
    require(counted, given, f"a whole number of 1 to {MAX_VALUES} values", where)
    positive = kind == "linspace" or (low >= LEAST and high >= LEAST)
    require(positive, given, "ends > 0", where)
    return {"kind": VALUES, "values": tuple(SPACED[kind](low, high, int(count)).tolist())}


def _values(given: Any, where: str) -> dict[str, Any]:
    typed = isinstance(given, list) and all(isinstance(item, int | float | str) for item in given)
    expected, fix = "a list of numbers, names or booleans", "write values = [0.3, 0.6]"
    require(typed and len(given) > 0, given, expected, where, fix=fix)
    kinds = {bool: "booleans", str: "texts"}
    alike = len({kinds.get(type(item), "numbers") for item in given}) == 1
    require(alike, given, "values of one kind: numbers, texts or booleans", where)
    return {"kind": VALUES, "values": tuple(given)}


def _numbers(given: Any, count: int, where: str) -> list[float]:
    listed = isinstance(given, list) and len(given) == count and all(map(is_number, given))
    small = listed and all(abs(item) <= LARGEST for item in given)
    expected = f"{count} finite numbers of at most {LARGEST:g}"
    require(small, given, expected, where, fix=f"write {EXAMPLE}")
    return [float(item) for item in given]


def _kind(read: Callable[[str, Any, str], dict[str, Any]], kind: str) -> tuple[Rule, None]:
    """Returns the rule of an optional key that names a kind."""
    return optional(partial(read, kind)), None


_KINDS: Rules = {
    VALUES: (optional(_values), None),
    **{kind: _kind(_spaced, kind) for kind in SPACED},
    **{kind: _kind(_distribution, kind) for kind in ENDS},
}
KINDS = tuple(_KINDS)
FACTOR: Rules = {**_KINDS, "unit": (text, ""), "relative": (boolean, False)}


def read_optimise(table: Any, where: str) -> tuple[Optimise, tuple[Factor, ...]]:
    """Returns the optimisation and its variables, which are settings or gains with bounds."""
    read = read_table(table, OPTIMISE, where)
    variables, metrics = read.pop("variables"), read.pop("metric")
    given = [factor.name for factor in variables]
    some = len(given) > 0 and SCENARIO_FACTOR not in given
    place = f"{where}.variables"
    require(some, given, "settings or gains", place, what="not variables")
    bounded = all(factor.kind != NORMAL for factor in variables)
    expected = "values, uniform, loguniform or integers"
    require(bounded, NORMAL, expected, place, what="a variable without bounds")
    _check_held_out(read["training"], read["held_out"], f"{where}.held_out")
    (sampler,) = read.pop("sampler") or ["tpe" if isinstance(table["metric"], str) else "nsga2"]
    return Optimise(metrics=metrics, sampler=sampler, **read), variables


def _evaluation(table: Any, where: str) -> Evaluation:
    read = read_table(table, EVALUATION, where)
    return Evaluation(cases=tuple(read["scenarios"]), seeds=read["seeds"])


def _check_held_out(training: Evaluation, held_out: Evaluation, where: str) -> None:
    """Raises StudyError for a held-out scenario or seed that is one of training.

    A seed draws the same changes in every scenario.
    """
    first, count = max(training.seeds) + 1, len(held_out.seeds)
    for key, one, other, fix in (
        ("scenarios", training.cases, held_out.cases, "name other scenarios"),
        (
            "seeds",
            training.seeds,
            held_out.seeds,
            f"write seeds = {{ first = {first}, count = {count} }}",
        ),
    ):
        common: Any = sorted(set(one) & set(other))
        what, expected = f"held-out {key} that are trained on", f"{key} that training does not use"
        require(not common, common, expected, f"{where}.{key}", what=what, fix=fix)


def _bounds(table: Any, where: str) -> tuple[Bound, ...]:
    """Returns the constraints, of which the first is that every run walks to its end."""
    found = [Bound(metric=WALKED, at_least=1.0)]
    require(isinstance(table, Mapping), table, "a table", where)
    require_known(table, OBJECTIVES, where, "metric")
    for name, limits in table.items():
        known = isinstance(limits, Mapping) and len(limits) > 0
        known = known and set(limits) <= {"at_least", "at_most"}
        known = known and all(map(is_number, limits.values()))
        expected, fix = "at_least or at_most and a number", "write { at_most = 1.0 }"
        place = f"{where}.{name}"
        require(known, limits, expected, place, what="not a constraint", fix=fix)
        found.append(Bound(metric=name, **{key: float(value) for key, value in limits.items()}))
    return tuple(found)


EVALUATION: Rules = {
    "scenarios": (texts('scenarios = ["walk_flat"]'), None),
    "seeds": (seeds(10_000), 1),
}
OPTIMISE: Rules = {
    "metric": (names(OBJECTIVES), None),
    "constraints": (_bounds, {}),
    "trials": (whole(1, 100_000), 50),
    "batch": (whole(1, 1000), 4),
    "sampler": (optional(names(SAMPLERS)), None),
    "control": (text, COMPARED[-1]),
    "variables": (read_factors, None),
    "training": (_evaluation, None),
    "held_out": (_evaluation, None),
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
    are the mean and the values one standard deviation away; a value further out is checked when it
    is run.
    """
    if factor.kind == VALUES:
        return factor.values
    if factor.kind == INTEGERS:
        return int(factor.low), int(factor.high)
    if factor.kind == NORMAL:
        return factor.low, factor.low - factor.high, factor.low + factor.high
    return factor.low, factor.high
