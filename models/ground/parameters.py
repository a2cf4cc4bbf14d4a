"""Parameters of the surfaces in the catalogue: units, ranges, defaults, difficulty.

Names are those of legged_gym and Isaac Lab. Their heights and widths are for robots of about 0.5 m
leg length; the defaults here are half of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.schema import Number, Spec, Text, missing_key, refuse_unknown_keys

DIFFICULTY = 0.2  # 1    default


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a surface.

    The default is a value, or a pair of values at difficulty 0 and 1 between which it is
    interpolated; None: the parameter has to be given.
    """

    spec: Spec
    default: float | str | tuple[float, float] | None
    about: str
    whole: bool = False  # whether the number is an integer

    def value(self, difficulty: float) -> float | str | None:
        """Returns the default at a difficulty."""
        if isinstance(self.default, tuple):
            easy, hard = self.default
            return easy + difficulty * (hard - easy)
        return self.default

    def text(self, value: float | str | None) -> str:
        """Returns a value with its unit; "-" for one that has to be given."""
        if value is None or isinstance(value, str):
            return value or "-"
        unit = self.spec.unit if isinstance(self.spec, Number) else "1"
        return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")

    def read(self, value: Any, where: str) -> float | str:
        """Returns the checked value. Raises RobotError; `where` names the key."""
        found = cast("float | str", self.spec.read(value, where))
        if self.whole and found != math.floor(float(found)):
            what = "not a whole number"
            fix = f"write {math.floor(float(found))}"
            raise RobotError(what, got=value, expected="a whole number", fix=fix, where=where)
        return found


def length(
    default: float | tuple[float, float] | None,
    about: str,
    *,
    least: float = 0.0,
    most: float = 100.0,
    zero: bool = False,
) -> Parameter:
    """Returns a parameter in metres above `least`, or from `least` on if `zero`."""
    bounds = {"at_least": least} if zero else {"above": least}
    return Parameter(spec=Number("m", at_most=most, **bounds), default=default, about=about)


def ratio(
    default: float | tuple[float, float] | None, about: str, *, least: float, most: float
) -> Parameter:
    """Returns a parameter without unit."""
    return Parameter(spec=Number("1", at_least=least, at_most=most), default=default, about=about)


def count(default: int, about: str, *, most: int = 10_000, least: int = 1) -> Parameter:
    """Returns a parameter that is a whole number."""
    spec = Number("1", at_least=least, at_most=most)
    return Parameter(spec=spec, default=default, about=about, whole=True)


def text(default: str | None, about: str) -> Parameter:
    """Returns a parameter that is a text."""
    return Parameter(spec=Text(), default=default, about=about)


Parameters = Mapping[str, Parameter]

SIZE = length(4.0, "edge of the map; the robot starts in its middle", least=0.1)
HORIZONTAL = length(0.05, "spacing of heights, or edge of a block", least=1e-3, zero=True)
VERTICAL = length(0.0025, "random heights are multiples of it", least=1e-6, zero=True)
PLATFORM = length(0.8, "edge of the flat square around the robot's start", zero=True)
HARD = ratio(DIFFICULTY, "0 easy to 1 hard; sets what is not given", least=0.0, most=1.0)
SEED = count(0, "of the random numbers", least=0, most=2**53)

TILE: Parameters = {
    "size": SIZE,
    "horizontal_scale": HORIZONTAL,
    "platform_size": PLATFORM,
    "difficulty": HARD,
}
RANDOM_TILE: Parameters = {**TILE, "vertical_scale": VERTICAL, "seed": SEED}


# legged_gym's 0.05 + 0.18 difficulty, by half
STEP_HEIGHT = length((0.025, 0.115), "height of a step")
STEP_WIDTH = length(0.15, "depth of a step's tread", least=0.01, zero=True)
DEPTH = length(0.3, "depth of the gaps")
STEPS: Parameters = {**TILE, "step_height": STEP_HEIGHT, "step_width": STEP_WIDTH}
ONE_STEP: Parameters = {**TILE, "step_height": STEP_HEIGHT}


@dataclass(frozen=True)
class Entry:
    """A surface of the catalogue."""

    about: str
    make: Callable[[SimpleNamespace], Surface]
    parameters: Parameters


Entries = dict[str, Entry]


def entry(
    table: Entries, about: str, parameters: Parameters
) -> Callable[[Callable[[SimpleNamespace], Surface]], Callable[[SimpleNamespace], Surface]]:
    """Returns a decorator that puts a surface into a table, by the name of its function."""

    def register(
        make: Callable[[SimpleNamespace], Surface],
    ) -> Callable[[SimpleNamespace], Surface]:
        table[make.__name__] = Entry(about, make, parameters)
        return make

    return register


def read_values(
    parameters: Parameters, given: Mapping[str, Any], where: str
) -> dict[str, float | str]:
    """Returns the values that a table gives of a surface's parameters. Raises RobotError."""
    refuse_unknown_keys(given, list(parameters), where)
    return {key: parameters[key].read(value, f"{where}.{key}") for key, value in given.items()}


def with_defaults(
    parameters: Parameters, given: Mapping[str, float | str], where: str
) -> dict[str, Any]:
    """Returns the values of all parameters. Raises RobotError for a missing one."""
    difficulty = float(given.get("difficulty", DIFFICULTY))
    values = {key: parameter.value(difficulty) for key, parameter in parameters.items()}
    values |= given
    for key, value in values.items():
        if value is None:
            spec = parameters[key].spec
            raise missing_key(key, spec, f"{where}.{key}")
        if parameters[key].whole:
            values[key] = int(value)
    return values
