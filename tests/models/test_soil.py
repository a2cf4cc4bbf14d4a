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
from hexapod_cosim.models.records import Foot, Soil
from hexapod_cosim.models.soil.granular import Coefficients, alpha_x, alpha_z, foot_resistances
from hexapod_cosim.models.soil.law import (
    contact_area,
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
    stored_energy,
    table_row,
    unloading_stiffness,
    virgin_force,
    virgin_slope,
    virgin_work,
)
from hexapod_cosim.models.soil.presets import list_soils, soil_preset, soil_table

SPHERE = load_robot("athena").foot  # R = 15 mm
TRIPOD = 18.3  # N  load of a foot of a tripod
CHECK = 1e-6  # relative: digits of the published check numbers
EXACT = 1e-12  # relative: rounding
DIFFERENCE = 1e-8  # relative: central differences of a step of 1e-6
GENERIC = Coefficients(
    A00=0.206,
    A10=0.169,
    B11=0.212,
    B01=0.358,
    Bm11=0.055,
    C11=-0.124,
    C01=0.253,
    Cm11=0.007,
    D10=0.088,
)
LAWS = (
    Soil(law="bekker", frictional_modulus=1.5e6, cohesive_modulus=900.0, exponent=1.1),
    Soil(law="bekker", frictional_modulus=1.3e6, exponent=0.7),
    Soil(law="granular", resistance=1e6),
    Soil(law="mud", yield_pressure=2e4, hardening=1e6),
)


def pad(radius: float) -> Foot:
    return replace(SPHERE, pad_radius=radius)


FEET = (SPHERE, pad(0.025))


def test_a_sphere_in_bekker_soil_has_the_closed_form_and_its_work() -> None:
    soil = Soil(law="bekker", frictional_modulus=1.594e6, exponent=1.1)
    assert virgin_force(soil, SPHERE, 0.008) == pytest.approx(2.339036, rel=CHECK)
    assert virgin_work(soil, SPHERE, 0.008) == pytest.approx(6.342144e-3, rel=CHECK)


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


@pytest.mark.parametrize("name", ["dry_sand", "lunar", "lunar_simulant_hit_lss1"])
def test_a_sphere_of_15_mm_sinks_past_its_centre_in_loose_soil(name: str) -> None:
    assert sinkage(soil_preset(name).soil, SPHERE, TRIPOD) > SPHERE.radius


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("soil", LAWS)
def test_work_and_slope_are_integral_and_derivative_of_the_virgin_force(
    soil: Soil, foot: Foot
) -> None:
    for z in (0.002, 0.0149, 0.0151, 0.04):
        h = 1e-6 * z
        force = [virgin_force(soil, foot, x) for x in (z - h, z, z + h)]
        work = [virgin_work(soil, foot, x) for x in (z - h, z + h)]
        assert (work[1] - work[0]) / (2 * h) == pytest.approx(force[1], rel=DIFFERENCE)
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


def test_the_second_step_touches_at_the_plastic_depth_and_a_plate_gives_back_its_energy() -> None:
    soil, foot, z = LAWS[0], pad(0.025), 0.0095
    sigma = virgin_force(soil, foot, z) / soil_area(foot)
    plastic = plastic_depth(soil, foot, z)
    assert plastic == pytest.approx(z - sigma / soil.stiffness, rel=EXACT)
    given_back = soil_area(foot) * sigma**2 / (2.0 * soil.stiffness)
    assert stored_energy(soil, foot, plastic, z) == pytest.approx(given_back, rel=1e-9)
    depths = np.linspace(plastic, z, 1001)
    force = [elastic_force(soil, foot, plastic, x) for x in depths]
    assert np.trapezoid(force, depths) == pytest.approx(given_back, rel=1e-9)


def test_a_dropped_pad_stops_where_its_energy_is_used_up() -> None:
    """m v0^2/2 + m g z = A k z^(n+1)/(n+1): the pad of this soil yields from the surface on."""
    m, g, v0, foot, soil = 2.0, 9.81, 0.5, pad(0.025), LAWS[0]
    z, v, h = 0.0, v0, 1e-6
    while v > 0.0:  # leapfrog
        z += 0.5 * h * v
        v += h * (g - elastic_force(soil, foot, plastic_depth(soil, foot, z), z) / m)
        z += 0.5 * h * v
    k = 1.5e6 + 900.0 / 0.025
    work = math.pi * 0.025**2 * k * z**2.1 / 2.1
    assert work == pytest.approx(0.5 * m * v0 * v0 + m * g * z, rel=CHECK)


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


def test_soil_never_pulls() -> None:
    soil, foot = LAWS[0], pad(0.025)
    assert soil_normal_force(soil, foot, 0.0, 0.001, -1.0) == 0.0
    assert soil_normal_force(soil, foot, 0.005, 0.004, 1.0) == 0.0
    assert soil_normal_slopes(soil, foot, 0.0, 0.001, -1.0) == (0.0, 0.0)


def test_the_cross_section_of_a_sphere_grows_to_its_equator() -> None:
    assert contact_area(SPHERE, 0.005) == pytest.approx(math.pi * (0.015**2 - 0.01**2), rel=EXACT)
    assert contact_area(SPHERE, 0.015) == contact_area(SPHERE, 0.1) == soil_area(SPHERE)


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


@pytest.mark.parametrize(
    ("beta", "gamma", "vertical", "horizontal"),
    [
        (0, 90, 1.000, None),
        (90, 0, 0.037, 0.370),
        (0, 0, 0.375, 0.136),
        (0, -90, -0.250, None),
        (30, 45, 0.7341854553574277, 0.29396329354996314),
    ],
)
def test_granular_resistance_has_its_anchors(
    beta: float, gamma: float, vertical: float, horizontal: float | None
) -> None:
    b, g = math.radians(beta), math.radians(gamma)
    assert alpha_z(GENERIC, b, g) == pytest.approx(vertical, rel=EXACT)
    expected = 0.0 if horizontal is None else horizontal
    assert alpha_x(GENERIC, b, g) == pytest.approx(expected, rel=EXACT, abs=1e-15)


def test_a_plate_that_moves_backwards_is_the_mirror_image() -> None:
    b, g = math.radians(25.0), math.radians(130.0)
    assert alpha_z(GENERIC, b, g) == pytest.approx(alpha_z(GENERIC, -b, math.pi - g), rel=EXACT)
    assert alpha_x(GENERIC, b, g) == pytest.approx(-alpha_x(GENERIC, -b, math.pi - g), rel=EXACT)
    below = math.radians(-130.0)
    assert alpha_z(GENERIC, b, below) == alpha_z(GENERIC, -b, -math.pi - below)


@pytest.mark.parametrize(
    ("name", "down", "ahead"),
    [("poppy_seed_loose", 0.254, 0.083), ("poppy_seed_close", 0.464, 0.107)],
)
def test_poppy_seeds_have_their_resistances(name: str, down: float, ahead: float) -> None:
    soil = soil_preset(name).soil
    assert soil.alpha_down == pytest.approx(down, rel=EXACT)
    assert soil.alpha_ahead == pytest.approx(ahead, rel=EXACT)


def test_a_hemisphere_in_granular_media_has_its_number() -> None:
    soil = Soil(law="granular", resistance=1e6, **foot_resistances(GENERIC))
    assert virgin_force(soil, SPHERE, 0.015) / (1e6 * 0.015**3) == pytest.approx(1.77186, rel=2e-6)
    assert virgin_force(soil, SPHERE, 0.015) == pytest.approx(5.980, abs=5e-4)
    shallow = virgin_force(soil, SPHERE, 1.5e-8) / (math.pi * 0.015 * 1e6 * 1.5e-8**2)
    assert shallow == pytest.approx(1.0, rel=1e-5)


def test_a_plate_on_edge_is_dragged_against_its_moment() -> None:
    """F_x = 0.370 zeta w h^2/2 of a plate of width w and height h; a pad is 2 a wide."""
    soil = Soil(law="granular", resistance=1e6)
    assert shear_limit(soil, pad(0.02), 0.03, 0.0) == pytest.approx(
        0.370e6 * 0.04 * 0.03**2 / 2.0, rel=EXACT
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


def test_every_preset_has_a_title_a_source_and_a_law() -> None:
    names = list_soils()
    assert {"dry_sand", "sandy_loam", "clay", "lete_sand", "snow", "lunar"} <= set(names)
    assert {"mars_simulant", "poppy_seed_loose", "poppy_seed_close", "mud"} <= set(names)
    for name in names:
        preset = soil_preset(name)
        assert preset.soil.law != "none"
        assert preset.title
        assert preset.source
        assert len(table_row(preset.soil)) == 13


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
