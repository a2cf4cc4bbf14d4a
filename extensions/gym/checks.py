"""Checks of what users pass to environments. Each raises HexapodError."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import HexapodError, unknown_name

LARGEST_SEED = 2**64 - 1


def check(holds: bool, what: str, got: object, expected: str) -> None:
    """Checks that a condition of a setting holds."""
    if not holds:
        raise HexapodError(what, got=got, expected=expected, fix="change this setting")


def numbers(value: Any) -> list[float]:
    """Returns the items of a value, or the value alone; nothing unless all are finite numbers."""
    items = list(value) if isinstance(value, Iterable) else [value]
    return items if all(isinstance(x, Real) and math.isfinite(x) for x in items) else []


def check_names(names: Iterable[str], what: str, valid: Iterable[str]) -> None:
    """Checks that all names are valid ones."""
    for name in names:
        if name not in valid:
            raise unknown_name(what, name, list(valid))


def check_range(name: str, given: object) -> None:
    """Checks that both ends of a range are finite and in order."""
    ends = numbers(given)
    holds = len(ends) == 2 and ends[0] <= ends[1]
    check(holds, name, given, "a range (lowest, highest) of finite numbers")


def check_count(what: str, count: object) -> None:
    """Checks that a count is a whole number from 1."""
    holds = isinstance(count, Integral) and int(count) >= 1
    check(holds, what, count, "a whole number, 1 or more")


def check_seeds(seeds: Sequence[object], count: int) -> None:
    """Checks that there is one seed for each environment, and that C can represent them."""
    check(len(seeds) == count, "seeds", f"{len(seeds)} of them", f"{count}, one for each")
    for seed in seeds:
        holds = isinstance(seed, Integral) and 0 <= int(seed) <= LARGEST_SEED
        check(holds, "seed", seed, f"a whole number from 0 to {LARGEST_SEED}")


def checked_mask(mask: Any, count: int) -> NDArray[np.uint8]:
    """Returns a mask of environments as C reads it."""
    array = np.asarray(mask)
    holds = array.dtype == np.bool_ and array.shape == (count,)
    got = f"shape {array.shape} of {array.dtype}"
    check(holds, "mask of environments", got, f"an array of {count} bool")
    return np.ascontiguousarray(array, dtype=np.uint8)
