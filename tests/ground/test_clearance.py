"""Tests the distances between neighbouring legs: C plant, twin, closed forms and brute force."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant
from states import changed, lopsided, random_pose

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.contact.pairs import clearances, leg_points, line_distance
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.records import Array

RING = (0, 1, 2, 5, 4, 3)  # LF LM LR RR RM RF
SAMPLES = 61  # of each line, by brute force


def brute_force(p: Array, a: Array, q: Array, b: Array) -> float:
    """Returns the least distance of samples of two lines, refined around the nearest pair."""
    (s, t), width = (0.5, 0.5), 0.5
    for _ in range(9):
        x = np.clip(np.linspace(s - width, s + width, SAMPLES), 0.0, 1.0)
        y = np.clip(np.linspace(t - width, t + width, SAMPLES), 0.0, 1.0)
        d = p + x[:, None, None] * a - q - y[None, :, None] * b
        far = np.linalg.norm(d, axis=2)
        i, j = np.unravel_index(int(np.argmin(far)), far.shape)
        s, t, width = float(x[i]), float(y[j]), width / 8.0
    return float(far.min())


def test_the_distance_of_lines_is_that_of_their_samples() -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        p, a, q, b = rng.normal(size=(4, 3))
        assert line_distance(p, a, q, b) == pytest.approx(brute_force(p, a, q, b), abs=1e-7)


def test_the_distance_of_lines_has_its_closed_forms() -> None:
    x, y, z = np.eye(3)
    o = np.zeros(3)
    assert line_distance(-x, 2.0 * x, 0.3 * z - y, 2.0 * y) == pytest.approx(0.3, abs=1e-15)
    assert line_distance(o, x, 0.5 * x + 0.2 * y, x) == pytest.approx(0.2, abs=1e-15)
    assert line_distance(o, x, 4.0 * x + 4.0 * y, x) == pytest.approx(5.0, abs=1e-15)
    assert line_distance(o, o, 3.0 * x + 4.0 * y, o) == pytest.approx(5.0, abs=1e-15)
    assert line_distance(o, 2.0 * x, x - y, 2.0 * y) == 0.0


def test_the_plants_clearance_is_that_of_the_twin_and_of_brute_force(core: ct.CDLL) -> None:
    size = {"knee_radius": 0.02, "shank_radius": 0.01}
    for seed, own in enumerate((load_robot("athena"), lopsided(1), lopsided(2))):
        robot = changed(own, body=size)
        body = body_states(robot, **random_pose(robot, seed))
        plant = Plant(core, robot)
        plant.bodies = body
        ours = plant.output().body.clearance
        assert ours == pytest.approx(clearances(robot, body), abs=1e-14)
        points, radius = leg_points(robot, body), (0.02, 0.01)
        least = np.full(6, np.inf)
        for leg, other in zip(RING, (*RING[1:], RING[0]), strict=True):
            for i in range(2):
                for j in range(2):
                    a = points[leg, i + 1] - points[leg, i]
                    b = points[other, j + 1] - points[other, j]
                    gap = brute_force(points[leg, i], a, points[other, j], b)
                    gap -= radius[i] + radius[j]
                    least[[leg, other]] = np.minimum(least[[leg, other]], gap)
        assert ours == pytest.approx(least, abs=1e-7)
