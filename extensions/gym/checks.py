"""Checks of what users pass to environments. Each raises HexapodError."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import HexapodError, unknown_name

LARGEST_SEED = 2**64 - 1


def refused(what: str, got: object, expected: str) -> HexapodError:
    """Returns the error of a setting that is not what it must be."""
    return HexapodError(what, got=got, expected=expected, fix="change this setting")


def is_finite(value: object) -> bool:
    """Returns whether a value is a finite number."""
    return isinstance(value, Real) and math.isfinite(value)


def listed(value: Any) -> list[Any]:
    """Returns the items of a value, or the value alone where it has none."""
    return list(value) if isinstance(value, Iterable) else [value]


def check_names(names: Iterable[str], what: str, valid: Iterable[str]) -> None:
    """Checks that all names are valid ones."""
    for name in names:
        if name not in valid:
            raise unknown_name(what, name, list(valid))


def check_mapping(name: str, given: object) -> None:
    """Checks that a value is a table whose keys are names."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise refused(name, given, "a table (a dict) from names to values")


def check_number(
    name: str, value: object, *, above: float = -math.inf, least: float = -math.inf
) -> None:
    """Checks that a value is a finite number that is above one bound and not below another."""
    if isinstance(value, Real) and math.isfinite(value) and above < float(value) >= least:
        return
    bound = f" above {above:g}" if above > -math.inf else ""
    bound += f", {least:g} or above" if least > -math.inf else ""
    raise refused(name, value, f"a finite number{bound}")


def check_range(name: str, given: object) -> None:
    """Checks that both ends of a range are finite and in order."""
    ends = listed(given)
    if len(ends) != 2 or not all(map(is_finite, ends)) or ends[0] > ends[1]:
        raise refused(name, given, "a range (lowest, highest) of finite numbers")


def check_widths(name: str, given: object) -> None:
    """Checks that a value is two finite numbers above 0."""
    widths = listed(given)
    if len(widths) != 2 or not all(is_finite(one) and one > 0.0 for one in widths):
        raise refused(name, given, "two finite numbers above 0")


def check_scale(name: str, given: object, *, axes: bool) -> None:
    """Checks the scale of an observed block: a number, or one for each axis if it has axes.

    A scale of 0 would leave the block out.
    """
    values = listed(given)
    if len(values) in {1, 3 if axes else 1} and all(map(is_finite, values)) and any(values):
        return
    own = ", or three of them for its axes" if axes else ""
    raise refused(name, given, f"a finite scale other than 0{own}; leave out what is not observed")


def check_count(what: str, count: object) -> None:
    """Checks that a count is a whole number from 1."""
    if not isinstance(count, Integral) or int(count) < 1:
        raise HexapodError(what, got=count, expected="a whole number, 1 or more", fix="give one")


def check_seeds(seeds: Sequence[object], count: int) -> None:
    """Checks that there is one seed for each environment, and that C can represent them."""
    if len(seeds) != count:
        raise HexapodError(
            "seeds", got=f"{len(seeds)} of them", expected=f"{count}, one for each environment"
        )
    for seed in seeds:
        if not isinstance(seed, Integral) or not 0 <= int(seed) <= LARGEST_SEED:
            raise HexapodError(
                "seed", got=seed, expected=f"a whole number from 0 to {LARGEST_SEED}"
            )


def checked_mask(mask: Any, count: int) -> NDArray[np.uint8]:
    """Returns a mask of environments as C reads it."""
    array = np.asarray(mask)
    if array.dtype != np.bool_ or array.shape != (count,):
        raise HexapodError(
            "mask of environments",
            got=f"shape {array.shape} of {array.dtype}",
            expected=f"an array of {count} bool",
        )
    return np.ascontiguousarray(array, dtype=np.uint8)
