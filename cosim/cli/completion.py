"""Shell completion: names of scenarios, robots and other choices, and keys of --set.

It reads names only and loads no robot.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import PATTERNS, Requirements
from hexapod_cosim.cosim.results.columns import Column, plant_variables
from hexapod_cosim.cosim.scenario.checks import setting_names
from hexapod_cosim.cosim.scenario.records import CONTROLS, KEYS, SECTIONS
from hexapod_cosim.cosim.scenario.tables import list_scenarios
from hexapod_cosim.models import list_robots
from hexapod_cosim.models.ground.catalogue import CATALOGUE
from hexapod_cosim.models.records import PLANES

Offers = list[tuple[str, str]]  # word, meaning
Complete = Callable[[str], Offers]


def _offering(words: Callable[[], Iterable[tuple[str, str]]]) -> Complete:
    """Returns a completion function that offers those words that begin as typed."""

    def complete(incomplete: str) -> Offers:
        return [(word, meaning) for word, meaning in words() if word.startswith(incomplete)]

    return complete


def _scenarios() -> Iterator[tuple[str, str]]:
    for name, path in list_scenarios().items():
        yield name, str(_toml(path).get("title", ""))


def _toml(path: Path) -> Mapping[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _settings() -> Iterator[tuple[str, str]]:
    """Yields keys of a scenario, then parameters of the plant's FMU, with their meaning."""
    for name in (
        *(key for key in KEYS if key not in SECTIONS or key == "control"),
        *setting_names(),
    ):
        yield f"{name}=", "of the scenario"
    for name, column in plant_variables("parameter").items():
        yield f"{name}=", _meaning(column)


def _meaning(column: Column) -> str:
    return f"{column.description} [{column.unit}]"


scenario = _offering(_scenarios)
setting = _offering(_settings)
surface = _offering(lambda: ((name, entry.about) for name, entry in CATALOGUE.items()))
terrain = _offering(
    lambda: (
        *((name, "plane without edges") for name in PLANES),
        *((name, entry.about) for name, entry in CATALOGUE.items()),
    )
)
robot = _offering(lambda: ((name, "") for name in list_robots()))
gait = _offering(
    lambda: ((name, f"duty factor {pattern.duty:.3g}") for name, pattern in PATTERNS.items())
)
control = _offering(lambda: ((name, "") for name in CONTROLS))
requirement = _offering(lambda: ((f"{item.name}=", "") for item in fields(Requirements)))
