"""Any ten numbers are a possible body, and every possible body has its ten numbers."""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.extensions.identify.numbers.inertia import BodyInertia, body_inertia
from hexapod_cosim.extensions.identify.unknowns import chosen_unknowns
from hexapod_cosim.models import load_robot


def tensor(inertia: tuple[float, ...]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_any_ten_numbers_are_a_body_whose_moments_obey_the_triangle_inequality() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        a, d, s, t = rng.normal(), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        body = BodyInertia(float(a), tuple(d), tuple(s), tuple(t))
        assert body.mass > 0.0
        x, y, z = np.linalg.eigvalsh(tensor(body.inertia))
        assert x > 0.0
        assert x + y > z * (1.0 - 1e-12)


def test_a_box_reads_back_with_its_mass_centre_and_inertia() -> None:
    inertia = (0.0100533, 0.0294667, 0.0367467, 1e-4, -2e-4, 3e-4)
    body = body_inertia(2.6, (0.01, -0.02, 0.03), inertia)
    assert body.mass == pytest.approx(2.6, rel=1e-15)
    assert body.com == (0.01, -0.02, 0.03)
    assert body.inertia == pytest.approx(inertia, rel=1e-12)


def test_the_mass_scales_the_inertia_and_the_size_its_square() -> None:
    body = body_inertia(2.0, (0.1, 0.0, 0.0), (0.010, 0.029, 0.036, 0.0, 0.0, 0.0))
    assert body.with_mass(3.0).inertia == pytest.approx(
        (0.015, 0.0435, 0.054, 0.0, 0.0, 0.0), rel=1e-12
    )
    assert body.scaled(2.0).inertia == pytest.approx(
        (0.040, 0.116, 0.144, 0.0, 0.0, 0.0), rel=1e-12
    )
    assert body.with_com((0.0, 0.2, 0.0)).inertia == pytest.approx(body.inertia, rel=1e-15)


def test_an_impossible_inertia_is_refused() -> None:
    with pytest.raises(ValueError, match="no body has the inertia"):
        body_inertia(1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 3.0, 0.0, 0.0, 0.0))


def test_the_centre_of_mass_of_a_link_stays_along_it() -> None:
    """From a quarter of the length before its joint to a quarter beyond the next: 0.10 m long."""
    robot = load_robot("athena")
    rows = {row.key: row for row in chosen_unknowns(robot, [], ("mass",))}
    row = rows["links.femur.com[1]"]
    assert row.value(-100.0, 0.065) == pytest.approx(-0.025, abs=1e-15)
    assert row.value(100.0, 0.065) == pytest.approx(0.125, abs=1e-15)
    assert row.bounds(0.065) == pytest.approx((-8.0, 6.0), abs=1e-12)
