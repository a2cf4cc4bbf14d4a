"""Tests the multi-loop disk margin: of one loop, of loops apart, and of the robot's FMU."""

from __future__ import annotations

import control
import numpy as np
import pytest

from hexapod_cosim.controller import Gains
from hexapod_cosim.controller.design.disk import DiskMargin, all_feet, disk_margin, scaled_norm
from hexapod_cosim.controller.design.laws import Laws, delay_steps
from hexapod_cosim.controller.design.loci import response
from hexapod_cosim.cosim.design.design_check import check_design
from hexapod_cosim.cosim.design.gain_design import design_for, examine_stances
from hexapod_cosim.models import load_robot

ROBOT, PERIOD = load_robot("athena"), 0.005
OMEGA = np.geomspace(0.01, 600.0, 4000)


def loop(gain: float) -> control.StateSpace:
    continuous = control.tf([gain], [1.0, 6.0, 5.0, 0.0])
    return control.ss(control.sample_system(continuous, PERIOD))


def answers(*gains: float) -> np.ndarray:
    """Returns a diagonal matrix of loops at each frequency."""
    found = np.zeros((len(OMEGA), len(gains), len(gains)), dtype=np.complex128)
    for k, gain in enumerate(gains):
        found[:, k, k] = response(loop(gain), OMEGA)[:, 0, 0]
    return found


@pytest.mark.parametrize("gain", [2.0, 5.0, 12.0])
def test_one_loop_has_the_disk_margin_of_python_control(gain: float) -> None:
    alpha, db, degrees = control.disk_margins(loop(gain), OMEGA, skew=0.0)
    found = disk_margin(answers(gain), OMEGA)
    assert found.alpha == pytest.approx(float(alpha), rel=1e-6)
    assert found.gain == pytest.approx(float(db), rel=1e-6)
    assert found.phase == pytest.approx(float(degrees), rel=1e-6)


def test_loops_apart_have_the_margin_of_the_worst_one_in_whatever_units() -> None:
    worst = disk_margin(answers(12.0), OMEGA).alpha
    apart = answers(2.0, 12.0, 5.0)
    assert disk_margin(apart, OMEGA).alpha == pytest.approx(worst)
    units = np.diag([1.0, 1e3, 1e-2])
    mixed = apart.copy()
    mixed[:, 0, 1], mixed[:, 1, 0] = 0.3 * apart[:, 0, 0], 0.1 * apart[:, 2, 2]
    scaled = units @ mixed @ np.linalg.inv(units)
    assert disk_margin(mixed, OMEGA).alpha < worst
    assert disk_margin(scaled, OMEGA).alpha == pytest.approx(disk_margin(mixed, OMEGA).alpha)


def test_the_bound_is_never_below_the_spectral_radius() -> None:
    """mu of any matrix lies between its spectral radius and its largest singular value."""
    draw = np.random.default_rng(4)
    for _ in range(20):
        matrix = draw.normal(size=(5, 5)) + 1j * draw.normal(size=(5, 5))
        bound = scaled_norm(matrix)
        assert np.abs(np.linalg.eigvals(matrix)).max() <= bound + 1e-12
        assert bound <= np.linalg.norm(matrix, 2) + 1e-12


def test_a_disk_of_radius_one_is_9_5_decibels_and_53_degrees() -> None:
    margin = DiskMargin(1.0, 0.0)
    assert margin.gain == pytest.approx(20.0 * np.log10(3.0))
    assert margin.phase == pytest.approx(53.130102)


@pytest.fixture(scope="module")
def gains(plant_build: object) -> Gains:
    return design_for(ROBOT, PERIOD)


def test_all_feet_together_keep_8_decibels_and_the_fmu_does_not_shake_within_them(
    gains: Gains,
) -> None:
    """Each foot's answer is made larger or smaller by the margin, alternately, in the FMU."""
    laws = Laws(
        slip=gains.slip, suspension=gains.suspension, period=PERIOD,
        delays=delay_steps(gains.requirements, period=PERIOD),
    )  # fmt: skip
    plants = examine_stances(ROBOT, PERIOD)[0]
    worst = min((all_feet(ROBOT, plant, laws) for plant in plants.values()), key=lambda m: m.alpha)
    assert worst.gain > 8.0
    assert worst.phase > 45.0
    factor = 10.0 ** (worst.gain / 20.0)
    for factors in ([factor, 1.0 / factor] * 3, [1.0 / factor, factor] * 3):
        force = check_design(ROBOT, gains, squeeze=1e-3, factors=np.array(factors)).simulated
        third = len(force) // 3
        assert abs(force[2 * third :]).max() < 0.2 * abs(force[:third]).max()
