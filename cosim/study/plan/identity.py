"""The identity of a run: a hash of the settings that decide its figures."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from hexapod_cosim.cosim.study.plan.records import Factor, Order, Value


def canonical(content: Any) -> bytes:
    """JSON whose bytes are the content's alone."""
    return json.dumps(content, sort_keys=True, default=str).encode()


def identity(order: Order, factors: Sequence[Factor]) -> str:
    """A hash of a run's settings, whatever its number."""
    settings = {factor.name: value for factor, value in zip(factors, order.values, strict=True)}
    return hashlib.sha256(canonical([order.case, settings, order.seed, order.control])).hexdigest()[
        :16
    ]


def settings_of(order: Order, factors: Sequence[Factor]) -> list[tuple[Factor, Value]]:
    """Each factor that is set, with its value."""
    return [
        (factor, value)
        for factor, value in zip(factors, order.values, strict=True)
        if value is not None
    ]
