"""The design: requirements met by python-control's judgement, kept in a file, told when impossible."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import control
import numpy as np
import pytest

from hexapod_cosim.controller import Gains, GainsError, LegSolver, Requirements, load_gains, save_gains
from hexapod_cosim.controller.design import design_gains, normal_loops, plot_design, tangential_loops
from hexapod_cosim.controller.design.leg import foot_dynamics, joint_inertia
from hexapod_cosim.controller.design.loops import (
    frequencies,
    loop_margins,
    quick_margins,
    response,
    sampled_slip_law,
    sampled_slip_response,
)
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
ROBOTS = ("athena", "phantomx_mk4")
MARGIN_ERROR = (0.5, 1.0)  # dB, deg    between two interpolations of a frequency grid


@cache
def designed(name: str) -> Gains:
    return design_gains(load_robot(name), PERIOD)


@pytest.fixture(scope="module", params=ROBOTS)
def gains(request: pytest.FixtureRequest) -> Gains:
    return designed(request.param)


def loops(gains: Gains) -> list[control.StateSpace]:
    robot, delay = load_robot(gains.robot), gains.requirements.delay_periods
    return [
        *tangential_loops(robot, gains.slip, period=gains.period, delay_periods=delay),
        *normal_loops(robot, gains.suspension, period=gains.period, delay_periods=delay),
    ]


def test_every_loop_keeps_the_margins_asked_for(gains: Gains) -> None:
    for loop in loops(gains):
        gain, phase, _ = loop_margins(loop, period=gains.period)
        assert gain >= gains.requirements.gain_margin
        assert phase >= gains.requirements.phase_margin


def test_every_closed_loop_is_stable(gains: Gains) -> None:
    for loop in loops(gains):
        closed = control.feedback(loop, control.ss([], [], [], [[1.0]], gains.period))
        size = np.sort(np.abs(closed.poles()))
        # the foot's place on the ground makes no force: with the integral action that is one hidden pole at 1
        hidden = int(abs(size[-1] - 1.0) < 1e-9)
        assert size[: len(size) - hidden].max() < 0.999


def test_the_quick_margins_are_python_controls(gains: Gains) -> None:
    for loop in loops(gains):
        gain, phase, _ = loop_margins(loop, period=gains.period)
        quick = quick_margins(response(loop, frequencies(gains.period), period=gains.period)[:, 0, 0])
        for mine, theirs, error in zip(quick, (gain, phase), MARGIN_ERROR, strict=True):
            assert mine == theirs or abs(mine - theirs) < error


def test_the_design_uses_the_margin_it_has(gains: Gains) -> None:
    """Half as much gain again breaks a margin of the tangential loop: the integral action is the most there is."""
    robot, more = load_robot(gains.robot), 1.5
    eager = replace(gains.slip, kp=more * gains.slip.kp, ki=more * gains.slip.ki, kd=more * gains.slip.kd)
    found = [loop_margins(loop, period=PERIOD) for loop in tangential_loops(robot, eager, period=PERIOD, delay_periods=1.0)]
    missed_gain = min(gain for gain, _, _ in found) < gains.requirements.gain_margin
    assert missed_gain or min(phase for _, phase, _ in found) < gains.requirements.phase_margin


def test_the_laws_closed_form_response_is_its_systems(gains: Gains) -> None:
    omega = frequencies(gains.period)
    system = sampled_slip_law(gains.slip, period=gains.period)
    np.testing.assert_allclose(
        sampled_slip_response(gains.slip, omega, period=gains.period), response(system, omega, period=gains.period), rtol=1e-6
    )
    np.testing.assert_allclose(
        response(system, omega, period=gains.period)[40], control.evalfr(system, np.exp(1j * omega[40] * PERIOD)), rtol=1e-9
    )


def test_foot_stiffness_answers_a_foot_displacement_with_the_servos_torques() -> None:
    robot = load_robot("athena")
    jacobian = LegSolver(robot).jacobian(robot.stance)
    shift = np.array([1e-3, -2e-3, 1.5e-3])
    for leg, foot in enumerate(foot_dynamics(robot)):
        torque = robot.servo.kp * np.linalg.solve(jacobian[leg], shift)
        np.testing.assert_allclose(jacobian[leg].T @ foot.stiffness @ shift, torque, rtol=1e-9)


def test_joint_inertia_gives_the_kinetic_energy_of_the_links() -> None:
    """One leg of point-like links turned about its coxa: sum m r^2, seen by the first entry."""
    leg = load_robot("athena").legs[1]
    inertia = joint_inertia(leg, rotor_inertia=0.02)
    np.testing.assert_allclose(inertia, inertia.T, atol=1e-15)
    assert np.linalg.eigvalsh(inertia).min() > 0.02
    straight = replace(leg, stance=(0.3, 0.0, 0.0))
    reach, expected = 0.0, 0.0
    for link in leg.links:
        expected += link.mass * (reach + link.com[0]) ** 2 + link.inertia[2]
        reach += link.length
    assert joint_inertia(straight, rotor_inertia=0.0)[0, 0] == pytest.approx(expected)


def test_gains_are_for_their_robot(gains: Gains) -> None:
    robot = load_robot(gains.robot)
    assert gains.mismatch(robot, period=PERIOD) is None
    heavier = replace(robot, torso=replace(robot.torso, mass=robot.torso.mass + 2.0))
    assert gains.mismatch(heavier, period=PERIOD) is not None
    assert design_gains(heavier, PERIOD).slip != gains.slip


def test_saved_gains_are_loaded_to_the_last_bit(gains: Gains, tmp_path: Path) -> None:
    assert load_gains(save_gains(gains, tmp_path / "gains.toml")) == gains
    assert [path.name for path in tmp_path.iterdir()] == ["gains.toml"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("tracking_time = ", "traking_time = ", "unknown key.*traking_time.*did you mean 'tracking_time'"),
        ("\n[slip]", "\n[slop]", "missing section.*\\[slip\\]"),
        ("stiffness = ", "stiffness = -", "suspension.stiffness: impossible value"),
        ("format = 1", "format = 9", "unknown format"),
        ("limit = ", "limit = true # ", "requirements.shift_limit: wrong type"),
        ("format = 1", "format = ", "not a TOML file"),
    ],
)
def test_a_damaged_gains_file_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = save_gains(designed("athena"), tmp_path / "gains.toml")
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(GainsError, match=message):
        load_gains(path)


def test_a_missing_file_or_folder_is_told(gains: Gains, tmp_path: Path) -> None:
    with pytest.raises(GainsError, match="cannot read the gains file"):
        load_gains(tmp_path / "none.toml")
    with pytest.raises(GainsError, match="cannot write the gains file"):
        save_gains(gains, tmp_path / "no" / "gains.toml")


def test_requirements_that_cannot_be_met_are_told_by_name() -> None:
    with pytest.raises(GainsError, match=r"misses its .* margin"):
        design_gains(load_robot("athena"), 0.05, requirements=Requirements(deflection=0.5, frequency=0.5, gain_margin=200.0))
    with pytest.raises(GainsError, match="frequency: impossible requirement"):
        design_gains(load_robot("athena"), PERIOD, requirements=Requirements(frequency=0.0))


def test_a_robot_without_position_servos_is_refused() -> None:
    robot = load_robot("athena")
    with pytest.raises(GainsError, match="compliant control shifts the servos' targets"):
        design_gains(replace(robot, servo=replace(robot.servo, mode="torque")), PERIOD)


def test_the_design_is_drawn(tmp_path: Path) -> None:
    gains = designed("athena")
    written = plot_design(gains, tmp_path)
    assert len(written) == 8
    assert all(path.stat().st_size > 5000 for path in written)
    with pytest.raises(GainsError, match="not the robot of these gains"):
        plot_design(gains, tmp_path, robot=load_robot("phantomx_mk4"))
