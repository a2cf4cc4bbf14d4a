"""Soft ground against closed forms: virgin curves and their works, sinkages of measured soils,
plastic memory, shear, and the resistance of granular media by direction.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.records import Foot
from hexapod_cosim.models.soil.law import (
    elastic_force,
    plastic_depth,
    profile_moment,
    shear_force,
    shear_limit,
    shear_rate,
    sinkage,
    soil_area,
    soil_normal_force,
    soil_normal_slopes,
    unloading_stiffness,
    virgin_force,
    virgin_slope,
)
from hexapod_cosim.models.soil.presets import Soil, soil_preset, soil_table

SPHERE = load_robot("athena").foot  # R = 15 mm
TRIPOD = 18.3  # N  load of a foot of a tripod
CHECK = 1e-6  # relative: digits of the published check numbers
EXACT = 1e-12  # relative: rounding
DIFFERENCE = 1e-8  # relative: central differences of a step of 1e-6
LAWS = (
    Soil(law="bekker", frictional_modulus=1.5e6, cohesive_modulus=900.0, exponent=1.1),
    Soil(law="bekker", frictional_modulus=1.3e6, exponent=0.7),
    Soil(law="granular", resistance=1e6),
    Soil(law="mud", yield_pressure=2e4, hardening=1e6),
)


def pad(radius: float) -> Foot:
    return replace(SPHERE, pad_radius=radius)


FEET = (SPHERE, pad(0.025))


def test_a_sphere_in_bekker_soil_has_the_closed_form() -> None:
    soil = Soil(law="bekker", frictional_modulus=1.594e6, exponent=1.1)
    assert virgin_force(soil, SPHERE, 0.008) == pytest.approx(2.339036, rel=CHECK)


@pytest.mark.parametrize(
    ("name", "sinkages"),
    [
        ("dry_sand", (23.6, 9.5, 4.1)),
        ("sandy_loam", (2.2, 0.6, 0.2)),
        ("clay", (0.3, 0.1, 0.0)),
        ("lete_sand", (0.4, 0.2, 0.1)),
        ("lunar", (28.3, 10.6, 4.3)),
        ("mars_simulant", (21.2, 8.8, 3.6)),
        ("lunar_simulant_hit_lss1", (11.7, 5.2, 2.4)),
        ("snow", (160.0, 100.0, 63.0)),
    ],
)
def test_pads_of_a_tripod_sink_as_deep_as_published(
    name: str, sinkages: tuple[float, float, float]
) -> None:
    soil = soil_preset(name).soil
    for radius, depth in zip((0.015, 0.025, 0.04), sinkages, strict=True):
        digits = 1.0 if name == "snow" else 0.1
        assert 1e3 * sinkage(soil, pad(radius), TRIPOD) == pytest.approx(depth, abs=digits)


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("soil", LAWS)
def test_the_slope_is_the_derivative_of_the_virgin_force(soil: Soil, foot: Foot) -> None:
    for z in (0.002, 0.0149, 0.0151, 0.04):
        h = 1e-6 * z
        force = [virgin_force(soil, foot, x) for x in (z - h, z, z + h)]
        slope = (force[2] - force[0]) / (2 * h)
        assert slope == pytest.approx(virgin_slope(soil, foot, z), rel=DIFFERENCE)


@pytest.mark.parametrize("soil", LAWS)
def test_a_sphere_is_the_sum_of_its_columns(soil: Soil) -> None:
    """Quadrature over the lower half of the sphere: of columns, of surface elements in granular
    media; above the equator nothing presses on the soil.
    """
    R = SPHERE.radius
    for z in (0.006, 0.015, 0.024):
        theta_end = math.acos(max(1.0 - z / R, 0.0))
        nodes, weights = np.polynomial.legendre.leggauss(200)
        theta = 0.5 * theta_end * (nodes + 1.0)
        depth = z - R * (1.0 - np.cos(theta))
        if soil.law == "granular":
            side, down = soil.alpha_side, soil.alpha_down
            share = side + (down - side) * np.cos(theta) ** 2
            stress, area = soil.resistance * share * depth, 2 * np.pi * R * R * np.sin(theta)
        else:
            k = soil.cohesive_modulus / R + soil.frictional_modulus
            stress = k * np.maximum(depth, 0.0) ** soil.exponent
            if soil.law == "mud":
                stress = soil.yield_pressure + soil.hardening * depth
            area = 2 * np.pi * R * R * np.sin(theta) * np.cos(theta)
        total = float(0.5 * theta_end * weights @ (stress * area))
        # the integrand's root at the rim limits the quadrature
        assert virgin_force(soil, SPHERE, z) == pytest.approx(total, rel=1e-5)


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("soil", LAWS)
def test_unloading_follows_its_line_and_loads_again_to_the_virgin_curve(
    soil: Soil, foot: Foot
) -> None:
    z = 0.009
    plastic = plastic_depth(soil, foot, z)
    stiffness = unloading_stiffness(soil, foot)
    full = virgin_force(soil, foot, z)
    assert plastic == pytest.approx(z - full / stiffness, rel=EXACT)
    assert elastic_force(soil, foot, plastic, z) == pytest.approx(full, rel=1e-9)
    half = plastic + 0.5 * (z - plastic)
    assert elastic_force(soil, foot, plastic, half) == pytest.approx(0.5 * full, rel=1e-9)
    assert elastic_force(soil, foot, plastic, plastic) == 0.0
    assert elastic_force(soil, foot, plastic, 0.012) == virgin_force(soil, foot, 0.012)


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("soil", LAWS)
def test_the_slopes_of_the_normal_force_are_its_derivatives(soil: Soil, foot: Foot) -> None:
    plastic = plastic_depth(soil, foot, 0.008)
    for z, dz in ((0.00799, 0.1), (0.012, 0.2), (0.012, -0.002), (0.02, 0.1)):
        k, c = soil_normal_slopes(soil, foot, plastic, z, dz)
        h = 1e-9
        ends = [soil_normal_force(soil, foot, plastic, z + s, dz) for s in (-h, h)]
        assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(k, rel=1e-5)
        ends = [soil_normal_force(soil, foot, plastic, z, dz + s) for s in (-1e-6, 1e-6)]
        assert (ends[1] - ends[0]) / 2e-6 == pytest.approx(c, rel=1e-6)


@pytest.mark.parametrize(("displacements", "share"), [(1.0, 0.632121), (3.0, 0.950213)])
def test_shear_in_one_direction_follows_janosi_and_hanamoto(
    displacements: float, share: float
) -> None:
    """The bristle's exact solution is K (1 - exp(-j/K)), whatever the speed."""
    soil = soil_preset("dry_sand").soil
    foot, K = pad(0.025), soil.shear_displacement
    limit = shear_limit(soil, foot, 0.0095, TRIPOD)
    strength = math.pi * 0.025**2 * 1040.0 + TRIPOD * math.tan(math.radians(28.0))
    assert limit == pytest.approx(strength, rel=EXACT)
    b, steps, j = np.zeros(3), 2000, displacements * K
    for speed in (0.1, 3.0):
        b, h = np.zeros(3), j / speed / steps
        slip = np.array([0.6, 0.8, 0.0]) * speed
        for _ in range(steps):
            middle = b + 0.5 * h * shear_rate(soil, slip, b)
            b = b + h * shear_rate(soil, slip, middle)
        force = float(np.linalg.norm(shear_force(soil, limit, b)))
        assert force / limit == pytest.approx(share, rel=CHECK)
    first = shear_force(soil, limit, 1e-6 * K * slip / speed)
    assert float(np.linalg.norm(first)) / (1e-6 * K) == pytest.approx(strength / K, rel=EXACT)


def test_the_steepest_slope_held_has_friction_and_cohesion() -> None:
    """tan(alpha) = tan(phi) + A c/F_n."""
    soil, foot, load = soil_preset("dry_sand").soil, pad(0.025), 15.0
    steepest = shear_limit(soil, foot, 0.01, load) / load
    assert steepest == pytest.approx(
        math.tan(soil.friction_angle) + soil_area(foot) * soil.cohesion / load, rel=EXACT
    )


def test_the_profile_of_a_sphere_is_the_integral_over_its_chords() -> None:
    R = SPHERE.radius
    for z in (0.004, 0.015, 0.021, 0.03, 0.05):
        x, weights = np.polynomial.legendre.leggauss(60)
        # heights y = R (1 - cos t) above the lowest point: the chords have no root in t
        end = math.acos(max(1.0 - z / R, -1.0))
        t = 0.5 * end * (x + 1.0)
        inner = (z - R * (1.0 - np.cos(t))) * 2.0 * R * np.sin(t) * R * np.sin(t)
        total = float(0.5 * end * weights @ inner)
        assert profile_moment(SPHERE, z) == pytest.approx(total, rel=1e-12)


def test_an_unknown_soil_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(RobotError, match="did you mean 'dry_sand'"):
        soil_table("dry_sands", "robot.toml: soil")


def test_a_soils_table_starts_from_a_preset() -> None:
    table = soil_table({"preset": "clay", "cohesion": 5000.0}, "robot.toml: soil")
    assert table["cohesion"] == 5000.0
    assert table["exponent"] == 0.5
    assert soil_table({"law": "mud"}, "robot.toml: soil") == {"law": "mud"}
    with pytest.raises(RobotError, match="expected a name"):
        soil_table({"preset": 3}, "robot.toml: soil")
