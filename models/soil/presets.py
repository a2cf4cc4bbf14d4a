"""Defines the data of a soil, and reads soils: measured ones by name from data/*.toml, and the
[soil] section of a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from hexapod_cosim.models.errors import HexapodError, RobotError, unknown_name
from hexapod_cosim.models.files import preset_tables
from hexapod_cosim.models.schema import Choice, Number, expect_table, read_given, require

SOIL_LAWS = ("none", "bekker", "granular", "mud")
PRESET = "preset"  # key of a table that starts from a soil of `list_soils()`


@dataclass(frozen=True, kw_only=True)
class Soil:
    """Law of soft ground and its numbers (eq. 40-46); each law uses those it names."""

    law: Annotated[str, Choice(SOIL_LAWS)] = "none"
    # bekker: pressure (Kc/b + Kphi) z^n
    frictional_modulus: Annotated[float, Number("N/m^(n+2)", at_least=0.0)] = 0.0
    cohesive_modulus: Annotated[float, Number("N/m^(n+1)", at_least=0.0)] = 0.0
    exponent: Annotated[float, Number("1", at_least=0.05, at_most=3.0)] = 1.0
    # granular: resistances of plates in units of `resistance`: facing down and moving down, on
    # edge and moving down, on edge and moving ahead
    resistance: Annotated[float, Number("N/m^3", at_least=0.0)] = 0.0
    alpha_down: Annotated[float, Number("1", at_least=0.0)] = 1.0
    alpha_side: Annotated[float, Number("1", at_least=0.0)] = 0.128
    alpha_ahead: Annotated[float, Number("1", at_least=0.0)] = 0.37
    # mud: pressure yield_pressure + hardening z
    yield_pressure: Annotated[float, Number("Pa", at_least=0.0)] = 0.0
    hardening: Annotated[float, Number("Pa/m", at_least=0.0)] = 0.0
    # all laws: shear strength, its displacement K, stiffness of unloading, damping
    cohesion: Annotated[float, Number("Pa", at_least=0.0)] = 0.0
    friction_angle: Annotated[float, Number("rad", at_least=0.0, at_most=1.4)] = 0.0
    shear_displacement: Annotated[float, Number("m", at_least=1e-5, at_most=1.0)] = 0.01
    stiffness: Annotated[float, Number("Pa/m", above=0.0)] = 4e8
    damping: Annotated[float, Number("Pa s/m", at_least=0.0)] = 3e4


@dataclass(frozen=True)
class Preset:
    """A soil with its title and the provenance of its numbers."""

    soil: Soil
    title: str
    source: str


@cache
def _presets() -> dict[str, Preset]:
    """Returns all presets, sorted by name."""
    found = {}
    for name, table, where in preset_tables(Path(__file__).parent / "data"):
        title, source = table.pop("title"), table.pop("source")
        soil = Soil(**require(Soil, read_given(Soil, table, where), where))
        found[name] = Preset(soil, title, source)
    return found


def list_soils() -> list[str]:
    """Returns the names of the soils in this package."""
    return list(_presets())


def soil_preset(
    name: str, *, where: str | None = None, error: type[HexapodError] = RobotError
) -> Preset:
    """Returns a soil by name. Raises `error` for a name outside `list_soils()`."""
    if name not in _presets():
        raise unknown_name("soil", name, list_soils(), where=where, error=error)
    return _presets()[name]


def soil_table(value: Any, where: str) -> Mapping[str, Any]:
    """Returns the table of numbers of a [soil] section. Raises RobotError.

    The section is the name of a soil or a table. The key `preset` of a table names the soil whose
    numbers the others replace.
    """
    table = {PRESET: value} if isinstance(value, str) else dict(expect_table(value, where))
    if PRESET not in table:
        return table
    name = table.pop(PRESET)
    if not isinstance(name, str):
        what = "wrong type"
        expected = "a name of `hexapod list soils`"
        fix = "give a name in quotes"
        raise RobotError(what, got=name, expected=expected, fix=fix, where=f"{where}.{PRESET}")
    return asdict(soil_preset(name, where=where).soil) | table
