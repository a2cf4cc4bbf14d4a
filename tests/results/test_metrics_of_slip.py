"""Tests metrics of slip, of the friction cone and of the stability margin on synthetic walks for
which they are known.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import DISTANCE, JUDGED, PARAMETERS, PERIOD, SPEED, WEIGHT, SyntheticRun

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.support import centre_of_mass, polygon_margins, stability_margins
from hexapod_cosim.models import LEG_NAMES, Robot, load_robot
from hexapod_cosim.models import energy as twin
from hexapod_cosim.models.kinematics import body_states

Array = NDArray[np.float64]


def test_slip_is_what_the_plant_counted_per_metre_walked() -> None:
    walk = SyntheticRun()
    walk.grow("LF.foot.slip_distance", 0.010)
    walk.grow("RM.foot.slip_distance", 0.005)
    walk.set("LF.foot.slip_speed", 5.0)  # what the rows show at their moments does not count
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.015 * JUDGED / DISTANCE)


@pytest.mark.parametrize("h", [0.005, 0.02, 0.03])  # of 0.03 s no row is at 2 s
def test_cumulative_figures_depend_on_no_row(h: float) -> None:
    """Steady growth gives the same in the measured time, whether or not rows lie at its ends."""
    walk = SyntheticRun(h=h)
    walk.grow("LF.foot.slip_distance", 0.010)
    walk.grow("LF.femur.positive_work", 3.0)
    walk.grow("LF.femur.torque_squared", 4.0)
    metrics = walk.metrics()
    assert metrics["slip_per_metre"] == pytest.approx(0.010 / 0.08)
    assert metrics["cost_of_transport"] == pytest.approx(3.0 / (0.08 * WEIGHT))
    assert metrics["torque_rms"] == pytest.approx(2.0 / math.sqrt(18.0))
    assert metrics["path_error"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("load", [0.02, 0.3])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_creep_of_the_tanh_law_is_no_net_slip(share: float, load: float) -> None:
    mu, slope, normal = 0.7, 100.0, load * WEIGHT
    walk = SyntheticRun()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", share * mu * normal)
    walk.set("LF.foot.slip_speed", math.atanh(share) / slope)
    assert walk.metrics(friction__mu=mu, friction__slope=slope)[
        "slip_net_per_metre"
    ] == pytest.approx(0.0, abs=1e-12)


def test_net_slip_is_what_exceeds_the_largest_creep() -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = SyntheticRun()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", mu * normal)
    walk.set("LF.foot.slip_speed", 0.5)
    walk.set("RM.foot.slip_speed", 0.5)  # in the air
    net = 0.5 - math.atanh(0.999) / slope
    assert walk.metrics(friction__mu=mu, friction__slope=slope)[
        "slip_net_per_metre"
    ] == pytest.approx(net / SPEED)


@pytest.mark.parametrize(
    ("stretched", "turn", "net"),
    [(0.5, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)],
)
def test_net_slip_of_bristles_is_what_they_do_not_give_back(
    stretched: float, turn: float, net: float
) -> None:
    """A bristle is a spring below break-away, slides when full, and springs back.

    Velocity along the normal is no slip.
    """
    walk = SyntheticRun()
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    for axis, part in (("1", 0.6), ("2", 0.8)):
        walk.set(f"LF.foot.velocity[{axis}]", turn * part * 0.05)
        walk.set(f"LF.foot.bristle[{axis}]", part * stretched * 5e-4)
    walk.set("LF.foot.velocity[3]", 0.4)
    metrics = walk.metrics(friction__law=3.0, friction__presliding=5e-4)
    assert metrics["slip_net_per_metre"] == pytest.approx(net * 0.05 / SPEED, abs=1e-12)


def use_cone(walk: SyntheticRun, share: float, rate: Array | float = 1.0) -> None:
    """Adds loaded feet that use this share of the cone, `rate` of them at a time (rows,).

    A bin begins at 0.9 (i/30)^2.
    """
    bins = [0.9 * (i / 30.0) ** 2 for i in range(31)]
    walk.grow(f"feet.cone_time[{sum(share >= begin for begin in bins)}]", rate)


def test_cone_use_is_what_the_plant_counted_over_time() -> None:
    """At 11 % for the most, at 20 %, and at 95 % of the cone for a tenth of the time.

    What rows show at their moments does not count.
    """
    walk = SyntheticRun()
    high = np.where(walk.time % PERIOD < 0.25, 1.0, 0.0)
    use_cone(walk, 0.11, 1.5)
    use_cone(walk, 0.20, 1.0 - high)
    use_cone(walk, 0.95, high)
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    walk.set("LF.foot.tangential_force", 0.3 * WEIGHT)
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_over_90"] == pytest.approx(0.10, abs=1e-3)
    assert 0.9 < metrics["cone_use_p95"] < 1.0
    assert 0.10 <= metrics["cone_use_p50"] <= 0.13


@pytest.mark.parametrize(
    ("largest", "p50", "p95", "bin_width"), [(0.80, 0.40, 0.76, 0.056), (0.10, 0.05, 0.095, 0.021)]
)
def test_cone_use_is_told_by_percentiles_over_time(
    largest: float, p50: float, p95: float, bin_width: float
) -> None:
    """From nothing to the largest share, evenly in time: within half a bin at the last
    percentile, much less in between.
    """
    walk = SyntheticRun()
    for i in range(30):
        begin, end = 0.9 * (i / 30.0) ** 2, 0.9 * ((i + 1) / 30.0) ** 2
        within = max(min(end, largest) - begin, 0.0) / largest
        if within > 0.0:
            use_cone(walk, 0.5 * (begin + end), within)
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_p50"] == pytest.approx(p50, rel=0.03)
    assert metrics["cone_use_p95"] == pytest.approx(p95, abs=0.5 * bin_width)
    assert metrics["cone_use_over_90"] == 0.0


@pytest.mark.parametrize(
    ("share", "p50", "p95"),
    [
        (0.0005, 0.00025, 0.0009025),  # from 0 to 0.9 (1/30)^2: 0.9 (0.5/30)^2, 0.9 (0.95/30)^2
        (0.15, 0.15625, 0.1677025),  # from 0.144 to 0.169: 0.9 (12.5/30)^2, 0.9 (12.95/30)^2
    ],
)
def test_within_a_bin_of_the_cone_time_is_even_over_the_root_of_the_share(
    share: float, p50: float, p95: float
) -> None:
    walk = SyntheticRun()
    use_cone(walk, share)
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_p50"] == pytest.approx(p50, rel=1e-12)
    assert metrics["cone_use_p95"] == pytest.approx(p95, rel=1e-12)


@pytest.mark.parametrize(("load", "counts"), [(0.0095, False), (0.0105, True)])
def test_a_foot_stands_on_a_hundredth_of_the_weight(load: float, counts: bool) -> None:
    walk = SyntheticRun()
    walk.set("LF.foot.normal_force", load * WEIGHT)
    metrics = walk.metrics(friction__mu=0.7)
    assert math.isfinite(metrics["force_p95"]) == counts
    assert math.isnan(metrics["cone_use_p95"])  # the plant counted no time


@pytest.mark.parametrize(
    "ground", [{"friction__mu": 0.0}, {"friction__law": 2.0}], ids=["no friction", "no law"]
)
def test_a_cone_that_is_not_there_is_not_used(ground: dict[str, float]) -> None:
    walk = SyntheticRun()
    use_cone(walk, 0.3)
    metrics = walk.metrics(**ground)
    assert all(
        math.isnan(metrics[name]) for name in ("cone_use_p50", "cone_use_p95", "cone_use_over_90")
    )


# The stability margin and the centre of mass.

SQUARE = np.array([[1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [0.0, -1.0], [-1.0, -1.0]])
ALL = [True] * 6


@pytest.mark.parametrize(
    ("standing", "centre", "margin"),
    [
        (ALL, (0.0, 0.0), 1.0),
        (ALL, (0.4, 0.1), 0.6),
        (ALL, (0.0, -0.75), 0.25),
        (ALL, (1.2, 0.0), -0.2),
        ([True, False, True, False, True, False], (0.0, 0.0), 1.0 / math.sqrt(5.0)),  # a tripod
        ([True, False, True, False, False, False], (0.0, 0.7), -0.3),  # a line
        ([True, False, False, False, False, False], (1.0, 1.0), math.nan),
        ([False] * 6, (0.0, 0.0), math.nan),
    ],
)
def test_the_margin_is_the_distance_to_the_nearest_edge(
    standing: list[bool], centre: tuple[float, float], margin: float
) -> None:
    got = polygon_margins(SQUARE[..., None], np.array([standing]), np.array(centre)[:, None])
    assert got == pytest.approx([margin], nan_ok=True)


def poses(robot: Robot, rows: int) -> tuple[Recording, list[Array]]:
    """Returns random poses as a recording, and the body states of models/ for them."""
    generator = np.random.default_rng(7)
    names = (
        "time",
        *joint_names("angle"),
        *vector_names("torso.position"),
        *vector_names("torso.quaternion", 4),
    )
    angle, position = 0.5 * generator.normal(size=(rows, 6, 3)), generator.normal(size=(rows, 3))
    quaternion = generator.normal(size=(rows, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    zero = np.zeros(3)
    bodies = [
        body_states(robot, r, p, zero, zero, joints, np.zeros((6, 3)))
        for r, p, joints in zip(position, quaternion, angle, strict=True)
    ]
    return Recording(
        names, np.column_stack([np.arange(rows), angle.reshape(rows, -1), position, quaternion])
    ), bodies


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_the_centre_of_mass_is_the_twins(name: str) -> None:
    robot = load_robot(name)
    parameters = {
        entry.name: float(entry.start or 0.0)
        for entry in load_interface(robot).variables
        if entry.causality == "parameter"
    }
    recording, bodies = poses(robot, 5)
    expected = [twin.centre_of_mass(robot, body) for body in bodies]
    np.testing.assert_allclose(centre_of_mass(recording, parameters), expected, atol=1e-12)


MASSLESS = (  # but for the torso
    PARAMETERS | {name: 0.0 for name in PARAMETERS if name.endswith(".mass")} | {"torso.mass": 1.0}
)


@pytest.mark.parametrize("up", [(0, 0, 1), (1, 0, 0), (0.95, 0.3, 0.1), (0.8, -0.6, 0)])
def test_the_margin_does_not_depend_on_the_worlds_axes(up: tuple[float, float, float]) -> None:
    way = np.array(up) / np.linalg.norm(up)
    # the rows of the third factor are orthonormal; those after the first span the plane
    across = np.linalg.svd(way[None])[2][1:]
    walk = SyntheticRun(cycles=0)
    for leg, place in zip(LEG_NAMES, SQUARE @ across, strict=True):
        for name, x in zip(vector_names(f"{leg}.foot.position"), place, strict=True):
            walk.set(name, x)
        walk.set(f"{leg}.foot.contact", 1.0)
    centre = way + np.array([0.4, 0.1]) @ across
    for name, x in zip(vector_names("torso.position"), centre, strict=True):
        walk.set(name, x)
    gravity = dict(zip(vector_names("gravity"), -9.81 * way, strict=True))
    assert stability_margins(walk.recording, MASSLESS | gravity) == pytest.approx([0.6])


def test_a_robot_on_a_slope_is_judged_along_gravity() -> None:
    walk = SyntheticRun(cycles=0)
    for leg, (x, y) in zip(LEG_NAMES, SQUARE, strict=True):
        walk.set(f"{leg}.foot.position[1]", x)
        walk.set(f"{leg}.foot.position[2]", y)
        walk.set(f"{leg}.foot.contact", 1.0)
    walk.set("torso.position[3]", 1.0)
    tilted = MASSLESS | {"gravity[1]": 9.81 * math.sin(0.1), "gravity[3]": -9.81 * math.cos(0.1)}
    assert stability_margins(walk.recording, MASSLESS) == pytest.approx([1.0])
    # the projection falls tan(0.1) ahead of the torso, and the square is seen foreshortened
    assert stability_margins(walk.recording, tilted) == pytest.approx(
        [(1.0 - math.tan(0.1)) * math.cos(0.1)]
    )
