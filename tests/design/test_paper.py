"""The paper's control: its laws at rest and at their limits, and the design of its gains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, make_gains

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, Parts, make_gait
from hexapod_cosim.cosim.run.preparation import designed_gains
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import HexapodError, load_robot

ATHENA = load_robot("athena")
WEIGHTED = np.array([0.0, 0.0, ATHENA.weight / 3.0])  # N    on each foot
SETTLED = 400  # periods    2 s, ten time constants of the suspension
ROUND_OFF = 1e-12  # m


def controller(parts: Parts | None = None) -> Controller:
    return Controller(
        ATHENA,
        period=PERIOD,
        gait=make_gait(ATHENA),
        gains=make_gains(ATHENA),
        parts=parts or Parts(),
        law="paper",
    )


def stand(walker: Controller, force: np.ndarray, steps: int = SETTLED) -> np.ndarray:
    """Returns the feet (6, 3) [m] that are commanded after some steps under constant forces."""
    measurement = Measurement(foot_force=np.tile(force, (6, 1)))
    for k in range(steps):
        out = walker.step(k * PERIOD, BodyCommand(), measurement)
    assert not out.torque_ref.any()
    return walker.legs.forward(out.angle_ref)


def test_under_a_normal_force_the_feet_rise_by_force_over_stiffness() -> None:
    still, loaded = (stand(controller(), force) for force in (0.0 * WEIGHTED, WEIGHTED))
    np.testing.assert_allclose(loaded - still, np.tile([0.0, 0.0, 0.003], (6, 1)), atol=1e-9)


def test_a_tangential_force_moves_the_feet_along_it_to_the_limit() -> None:
    along = np.array([0.6, -0.8, 0.0])
    still, pushed = (stand(controller(), force) for force in (0.0 * along, along))
    shift = pushed - still
    # kp + ki t of a unit force exceeds the limit of 15 mm after 7.5 s
    assert np.linalg.norm(shift, axis=1) == pytest.approx(np.full(6, 1e-4 + 2e-3 * 1.975), rel=1e-2)
    np.testing.assert_allclose(shift @ [0.8, 0.6, 0.0], 0.0, atol=1e-6)
    limited = stand(controller(), 1000.0 * along) - still
    np.testing.assert_allclose(limited, np.tile(0.015 * along, (6, 1)), atol=ROUND_OFF)


def test_the_angles_are_the_inverse_kinematics_of_the_corrected_feet() -> None:
    walker, force = controller(), np.array([2.0, 1.0, ATHENA.weight / 3.0])
    measurement = Measurement(foot_force=np.tile(force, (6, 1)))
    for k in range(300):
        out = walker.step(k * PERIOD, BodyCommand(vx=0.05), measurement)
        shown = walker.diagnostics
        wanted = shown.planned + np.column_stack([shown.shift.real, shown.shift.imag, shown.lift])
        np.testing.assert_allclose(walker.legs.forward(out.angle_ref), wanted, atol=1e-9)


def test_without_both_parts_it_is_kinematic_control() -> None:
    off = controller(Parts(slip_pid=False, paper_suspension=False))
    plain = Controller(ATHENA, period=PERIOD, gait=make_gait(ATHENA))
    measurement = Measurement(foot_force=np.tile(WEIGHTED + 3.0, (6, 1)))
    for k in range(400):
        ours, theirs = (
            walker.step(k * PERIOD, BodyCommand(vx=0.05), measurement) for walker in (off, plain)
        )
        np.testing.assert_array_equal(ours.angle_ref, theirs.angle_ref)
        np.testing.assert_array_equal(ours.speed_ref, theirs.speed_ref)


def test_a_saved_state_continues_with_the_same_bits() -> None:
    walker, other = controller(), controller()
    measurement = Measurement(foot_force=np.tile(WEIGHTED + 1.0, (6, 1)))
    for k in range(250):
        walker.step(k * PERIOD, BodyCommand(vx=0.05), measurement)
    other.restore(walker.save())
    for k in range(250, 400):
        ours, theirs = (
            one.step(k * PERIOD, BodyCommand(vx=0.05), measurement).angle_ref.copy()
            for one in (walker, other)
        )
        np.testing.assert_array_equal(ours, theirs)


def test_an_unknown_law_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(HexapodError, match="paper"):
        Controller(
            ATHENA, period=PERIOD, gait=make_gait(ATHENA), gains=make_gains(ATHENA), law="papr"
        )


@pytest.mark.usefixtures("plant_build")
def test_the_designed_loops_have_the_required_margins() -> None:
    gains = designed_gains(ATHENA, PERIOD)
    needs, margins = gains.requirements, gains.margins
    assert margins.paper_phase_margin >= needs.phase_margin
    assert margins.paper_gain_margin >= needs.gain_margin
    assert margins.paper_spectral_radius < 1.0
    assert gains.paper_slip.ki > 0.0
    assert ATHENA.weight / 3.0 / gains.paper_suspension.stiffness == pytest.approx(needs.deflection)


@pytest.mark.usefixtures("plant_build")
def test_a_scenario_walks_under_the_papers_control_without_feed_forward() -> None:
    scenario = replace(load_scenario("walk_flat", overrides=["control=paper"]), duration=2.0)
    result = simulate(scenario, gains=make_gains(ATHENA))
    assert result.completed
    recording = result.outcome.recording
    torques = [name for name in recording.names if name.endswith(".torque_ref")]
    assert len(torques) == 18
    assert not recording.columns(torques).any()
