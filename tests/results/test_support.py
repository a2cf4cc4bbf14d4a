"""The stability margin and the centre of mass."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import PARAMETERS, Walk

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.support import centre_of_mass, polygon_margins, stability_margins
from hexapod_cosim.models import LEG_NAMES, Robot, load_robot
from hexapod_cosim.models import energy as twin
from hexapod_cosim.models.kinematics import body_states

Array = NDArray[np.float64]

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
    walk = Walk(cycles=0)
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
    walk = Walk(cycles=0)
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
