"""Forces of soft ground: the C functions equal those of models/soil/law.py."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import HxSoilDefinition, Real
from plant import pointer

from hexapod_cosim.models import SOIL_LAWS, load_robot
from hexapod_cosim.models.records import Foot, Soil
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.presets import list_soils, soil_preset

EXACT = 1e-14  # relative
SLOPE = 1e-13  # relative: below its equator a sphere's slope is a difference of similar terms
SPHERE = load_robot("athena").foot
FEET = (SPHERE, replace(SPHERE, pad_radius=0.025))
MOTIONS = (  # plastic depth, depth [m], sinking speed [m/s]
    (0.0, 0.003, 0.2),
    (0.0, 0.014, -0.01),
    (0.0079, 0.00799, 0.1),
    (0.0079, 0.0079, 0.1),
    (0.0, 0.0225, 0.05),
    (0.01, 0.05, 0.0),
    (0.0, 0.002, -3.0),
    (0.0, -0.001, 0.2),
)


def definition(soil: Soil) -> Any:
    d: Any = HxSoilDefinition()
    d.law = 1 + SOIL_LAWS.index(soil.law)
    for name, kind in d._fields_:
        if kind is Real:
            setattr(d, name, getattr(soil, name))
    return d


def computed(
    core: ct.CDLL, soil: Soil, foot: Foot, motion: tuple[float, float, float], row: bool = False
) -> list[float]:
    out = np.full(12, np.nan)
    columns = np.array(law.table_row(soil)) if row else None
    core.hx_probe_soil(
        ct.byref(definition(soil)),
        None if columns is None else pointer(columns),
        *map(Real, (foot.radius, foot.pad_radius, *motion)),
        pointer(out),
    )
    return list(out)


def expected(soil: Soil, foot: Foot, motion: tuple[float, float, float]) -> list[float]:
    plastic, z, dz = motion
    base = law.shear_limit(soil, foot, z, 0.0)
    return [
        law.virgin_force(soil, foot, z),
        law.virgin_slope(soil, foot, z),
        law.plastic_depth(soil, foot, z),
        law.soil_normal_force(soil, foot, plastic, z, dz),
        law.elastic_force(soil, foot, plastic, z),
        *law.soil_normal_slopes(soil, foot, plastic, z, dz),
        law.stored_energy(soil, foot, plastic, z),
        base,
    ]


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("name", list_soils())
def test_the_forces_of_soil_are_those_of_the_model(core: ct.CDLL, name: str, foot: Foot) -> None:
    soil = soil_preset(name).soil
    for motion in MOTIONS[:-1]:
        got = computed(core, soil, foot, motion)
        model = expected(soil, foot, motion)
        assert got[:9] == pytest.approx(model, rel=SLOPE, abs=1e-300)
        for force in (0, 2, 3, 4, 6, 7, 8):
            assert got[force] == pytest.approx(model[force], rel=EXACT, abs=1e-300)


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("name", list_soils())
def test_a_row_of_a_grids_table_is_the_same_soil(core: ct.CDLL, name: str, foot: Foot) -> None:
    soil = soil_preset(name).soil
    for motion in MOTIONS[:-1]:
        got = computed(core, soil, foot, motion, row=True)
        assert got == pytest.approx(computed(core, soil, foot, motion), rel=EXACT)


def test_a_law_that_is_linear_in_the_depth_has_finite_slopes_under_a_pad_that_just_touches(
    core: ct.CDLL,
) -> None:
    """The square of such a depth is 0 in floating point."""
    linear = replace(soil_preset("dry_sand").soil, exponent=1.0)
    for soil in (soil_preset("mud").soil, linear):
        assert np.isfinite(computed(core, soil, FEET[1], (0.0, 1e-170, 0.1))).all()
