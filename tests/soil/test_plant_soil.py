"""Tests forces of soft ground: the C functions equal those of models/soil/law.py, and figures of
the measured soils follow from their published numbers.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import HxSoilDefinition, Real
from plant import pointer
from scipy.integrate import quad

from hexapod_cosim.models import SOIL_LAWS, load_robot
from hexapod_cosim.models.records import Foot
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.presets import Soil, list_soils, soil_preset

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
    out = np.full(10, np.nan)
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


# Figures of the measured soils, from their published numbers: force, work and plastic depth of a
# pad, force of a sphere, shear strength. Twin and C plant have them.

CHECK = 1e-6  # relative
BALL = load_robot("athena").foot  # of 15 mm
PAD = replace(BALL, pad_radius=0.025)
DEPTH = 0.008  # m
LOAD = 18.3  # N
# force [N], work [J] of the pad; force [N] of the sphere; of the pad plastic depth [m], energy that
# it gives back [J], shear strength under LOAD [N]
FIGURES = (
    ("dry_sand", 15.1978881, 0.0578967167, 2.33966694, 0.00798064945, 1.47043763e-4, 11.7723178),
    ("sandy_loam", 115.396706, 0.543043322, 22.6204918, 0.00785307235, 0.00847748336, 13.5210677),
    ("clay", 214.212944, 1.14246904, 55.5795948, 0.00772725561, 0.0292126896, 12.3537589),
    ("lete_sand", 400.34037, 1.78623701, 89.4799822, 0.00749027081, 0.102032586, 13.5918098),
    ("snow", 0.322074297, 9.90997836e-4, 0.0532308132, 0.00799958992, 6.60377484e-8, 8.5747489),
    ("lunar", 13.7601758, 0.0550407033, 2.26485094, 0.00798248, 1.2053914e-4, 13.1475922),
    (
        "mars_simulant",
        16.9815468,
        0.0754735412,
        4.03279974,
        0.00797837842,
        1.8358391e-4,
        6.46453584,
    ),
    (
        "poppy_seed_loose",
        3.98982267,
        0.0159592907,
        0.543001252,
        0.00799492,
        1.01341496e-5,
        5.92157551,
    ),
    (
        "poppy_seed_close",
        7.28849496,
        0.0291539798,
        0.992334453,
        0.00799072,
        3.38186166e-5,
        6.56636129,
    ),
)
DISPLACEMENT = {
    "sandy_loam": 0.02,
    "clay": 0.02,
    "lete_sand": 0.012,
    "snow": 0.03,
    "lunar": 0.018,
}  # m, others 0.01


@pytest.mark.parametrize(("name", "force", "work", "ball", "plastic", "back", "shear"), FIGURES)
def test_a_measured_soil_has_its_figures(
    core: ct.CDLL,
    name: str,
    force: float,
    work: float,
    ball: float,
    plastic: float,
    back: float,
    shear: float,
) -> None:
    soil = soil_preset(name).soil
    z_p = law.plastic_depth(soil, PAD, DEPTH)
    limit = law.shear_limit(soil, PAD, DEPTH, LOAD)
    assert law.virgin_force(soil, PAD, DEPTH) == pytest.approx(force, rel=CHECK)
    taken = quad(lambda z: law.virgin_force(soil, PAD, z), 0.0, DEPTH)[0]
    assert taken == pytest.approx(work, rel=CHECK)
    assert law.virgin_force(soil, BALL, DEPTH) == pytest.approx(ball, rel=CHECK)
    assert z_p == pytest.approx(plastic, rel=CHECK)
    assert law.stored_energy(soil, PAD, z_p, DEPTH) == pytest.approx(back, rel=CHECK)
    assert limit == pytest.approx(shear, rel=CHECK)
    pressed = computed(core, soil, PAD, (plastic, DEPTH, 0.0))
    assert pressed[0] == pytest.approx(force, rel=CHECK)
    assert pressed[2] == pytest.approx(plastic, rel=CHECK)
    assert computed(core, soil, PAD, (z_p, DEPTH, 0.0))[7] == pytest.approx(back, rel=CHECK)
    assert pressed[8] + LOAD * math.tan(soil.friction_angle) == pytest.approx(shear, rel=CHECK)
    assert computed(core, soil, BALL, (0.0, DEPTH, 0.0))[0] == pytest.approx(ball, rel=CHECK)


@pytest.mark.parametrize("name", [figures[0] for figures in FIGURES])
def test_the_shear_curve_of_a_measured_soil_has_its_points(name: str) -> None:
    """63.2 % of the strength after one shear displacement K, 95.0 % after three, and the slope
    T_max/K at the start; the bristle after a way j is K (1 - exp(-j/K)).
    """
    soil, along = soil_preset(name).soil, np.array([0.6, -0.8, 0.0])
    K = DISPLACEMENT.get(name, 0.01)
    assert soil.shear_displacement == K
    limit = law.shear_limit(soil, PAD, DEPTH, LOAD)
    for way, share in ((1.0, 0.6321205588), (3.0, 0.9502129316)):
        b = K * share * along
        assert law.shear_force(soil, limit, b) == pytest.approx(-share * limit * along, rel=CHECK)
        rate = law.shear_rate(soil, 0.3 * along, b)
        assert rate == pytest.approx(0.3 * math.exp(-way) * along, rel=CHECK)
    small = law.shear_force(soil, limit, 1e-9 * along)
    assert float(np.linalg.norm(small)) / 1e-9 == pytest.approx(limit / K, rel=CHECK)
