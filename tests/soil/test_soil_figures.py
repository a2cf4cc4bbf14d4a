"""Figures of the measured soils, from their published numbers: force, work and plastic depth of a
pad, force of a sphere, shear strength. Twin and C plant have them.

The expected values were computed apart from this project: forces of spheres and works by numerical
quadrature of the pressure over columns (Bekker) or surface elements (granular).
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace

import numpy as np
import pytest
from test_plant_soil import computed

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.presets import soil_preset

CHECK = 1e-6  # relative
SPHERE = load_robot("athena").foot  # of 15 mm
PAD = replace(SPHERE, pad_radius=0.025)
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
    assert law.virgin_work(soil, PAD, DEPTH) == pytest.approx(work, rel=CHECK)
    assert law.virgin_force(soil, SPHERE, DEPTH) == pytest.approx(ball, rel=CHECK)
    assert z_p == pytest.approx(plastic, rel=CHECK)
    assert law.stored_energy(soil, PAD, z_p, DEPTH) == pytest.approx(back, rel=CHECK)
    assert limit == pytest.approx(shear, rel=CHECK)
    pressed = computed(core, soil, PAD, (plastic, DEPTH, 0.0))
    assert pressed[0] == pytest.approx(force, rel=CHECK)
    assert pressed[2] == pytest.approx(plastic, rel=CHECK)
    assert computed(core, soil, PAD, (z_p, DEPTH, 0.0))[7] == pytest.approx(back, rel=CHECK)
    assert pressed[8] + LOAD * math.tan(soil.friction_angle) == pytest.approx(shear, rel=CHECK)
    assert computed(core, soil, SPHERE, (0.0, DEPTH, 0.0))[0] == pytest.approx(ball, rel=CHECK)


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
