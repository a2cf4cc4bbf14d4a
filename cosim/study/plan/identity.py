"""The identity of a run: a hash of the settings that its figures depend on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from hexapod_cosim.cosim.study.plan.records import Factor, Order, Value


def canonical(content: Any) -> bytes:
    """Returns JSON with sorted keys, whose bytes depend on the content only."""
    return json.dumps(content, sort_keys=True, default=str).encode()


def identity(order: Order, factors: Sequence[Factor]) -> str:
    """Returns the hash of a run's settings, which does not depend on its number."""
    settings = {factor.name: value for factor, value in zip(factors, order.values, strict=True)}
    return hashlib.sha256(canonical([order.case, settings, order.seed, order.control])).hexdigest()[
        :16
    ]


def settings_of(order: Order, factors: Sequence[Factor]) -> list[tuple[Factor, Value]]:
    """Returns the factors that the order sets, with their values."""
    return [
        (factor, value)
        for factor, value in zip(factors, order.values, strict=True)
        if value is not None
    ]
