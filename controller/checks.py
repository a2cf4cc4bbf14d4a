"""Checks what a controller is built from."""

from __future__ import annotations

from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.models import HexapodError, unknown_name
from hexapod_cosim.models.errors import check_type

LAWS = ("compliant", "paper")  # what the feet's forces do; without gains control is kinematic


class ControllerError(HexapodError):
    """The controller cannot be built, or was called at a wrong time."""


def check_period(period: float, gait: Gait) -> None:
    """Raises ControllerError unless stance and swing of the gait are longer than the period [s]."""
    check_type(period, (int, float), "a number of s", where="period", error=ControllerError)
    check_type(gait, Gait, "a Gait, as of make_gait()", where="gait", error=ControllerError)
    shorter = gait.period * min(gait.duty, 1.0 - gait.duty)
    if not 0.0 < period < shorter:
        raise ControllerError(
            "impossible controller period",
            got=period,
            expected=f"0 < period < {shorter:g} s, the gait's shorter phase",
            fix="shorten the period or slow the gait",
        )


def check_law(law: str) -> None:
    """Raises HexapodError for an unknown name."""
    if law not in LAWS:
        raise unknown_name("law", law, LAWS)
