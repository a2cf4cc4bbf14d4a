"""Shell completion: names of scenarios, robots and other choices, and keys of --set.

It reads names only and loads no robot; what it needs is imported when it is asked.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator

Offers = list[tuple[str, str]]  # word, meaning
Complete = Callable[[str], Offers]


def _offering(words: Callable[[], Iterable[tuple[str, str]]]) -> Complete:
    """Returns a completion function that offers those words that begin as typed."""

    def complete(incomplete: str) -> Offers:
        return [(word, meaning) for word, meaning in words() if word.startswith(incomplete)]

    return complete


def _scenarios() -> Iterator[tuple[str, str]]:
    from hexapod_cosim.cosim.scenario import list_scenarios

    for name, path in list_scenarios().items():
        yield name, str(tomllib.loads(path.read_text(encoding="utf-8")).get("title", ""))


def _settings() -> Iterator[tuple[str, str]]:
    """Yields keys of a scenario, then parameters of the plant's FMU, with their meaning."""
    from hexapod_cosim.cosim.results.columns import plant_variables
    from hexapod_cosim.cosim.scenario.checks import setting_names
    from hexapod_cosim.cosim.scenario.records import KEYS, SECTIONS

    plain = [key for key in KEYS if key not in SECTIONS or key == "control"]
    for name in (*plain, *setting_names()):
        yield f"{name}=", "of the scenario"
    for name, column in plant_variables("parameter").items():
        yield f"{name}=", f"{column.description} [{column.unit}]"


def _surfaces() -> Iterator[tuple[str, str]]:
    from hexapod_cosim.models.ground.table import CATALOGUE

    for name, entry in CATALOGUE.items():
        yield name, entry.about


def _robots() -> Iterator[tuple[str, str]]:
    from hexapod_cosim.models import list_robots

    for name in list_robots():
        yield name, ""


def _controls() -> Iterator[tuple[str, str]]:
    from hexapod_cosim.cosim.scenario.records import CONTROLS

    for name in CONTROLS:
        yield name, ""


scenario = _offering(_scenarios)
setting = _offering(_settings)
surface = _offering(_surfaces)
robot = _offering(_robots)
control = _offering(_controls)
