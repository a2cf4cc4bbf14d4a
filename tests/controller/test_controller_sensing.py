"""Tests how compliant control uses its sensors: axes of forces, positions of feet,
wrong sensors.
"""

from __future__ import annotations

import numpy as np
import pytest
from controllers import make, obey, run, squeezed
from gains import PERIOD

from hexapod_cosim.controller import BodyCommand, Measurement, Parts
from hexapod_cosim.controller.comply.compliant import sense
from hexapod_cosim.controller.walk.hold import Sight
from hexapod_cosim.models.kinematics import axis_quaternion, quaternion_product


def test_the_forces_on_a_torso_that_leans_as_commanded_are_judged_upright() -> None:
    roll, pitch = 0.2, -0.15
    controller, measurement = make(compliant=True), squeezed()
    pitched, rolled = (
        axis_quaternion(np.array([0.0, 1.0, 0.0]), pitch),
        axis_quaternion(np.array([1.0, 0.0, 0.0]), roll),
    )
    measurement.quaternion[:] = quaternion_product(pitched, rolled)
    run(controller, BodyCommand(roll=roll, pitch=pitch), 300, measurement=measurement)
    compliant = controller.compliant
    assert compliant is not None
    np.testing.assert_allclose(
        sense(measurement, compliant.stance.posture), measurement.foot_force, atol=1e-12
    )


@pytest.mark.parametrize(
    "command",
    [
        BodyCommand(),
        BodyCommand(height=0.01, roll=0.1, pitch=-0.05),
        BodyCommand(vx=0.05, yaw_rate=0.1),
    ],
)
def test_the_slow_loops_see_a_robot_that_does_what_is_planned_where_it_is_planned(
    command: BodyCommand, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller, seen = make(compliant=True, parts=Parts(path=False, posture=False)), list[Sight]()
    assert controller.compliant is not None
    monkeypatch.setattr(controller.compliant.hold, "look", seen.append)
    obey(controller, command, 600)
    for sight in seen[-10:]:
        lag = (
            PERIOD * (0.05 + 0.1 * 0.3) if command.vx else 0.0
        )  # m; joints are where they were commanded to be a period ago
        standing = np.array(sight.load) > 0.5
        np.testing.assert_allclose(
            np.array(sight.plane)[standing], np.array(sight.planned)[standing], atol=lag + 2e-5
        )
        np.testing.assert_allclose(
            np.array(sight.height)[standing], np.array(sight.planned_height)[standing], atol=1e-4
        )
        assert sight.tilt.tolist() == pytest.approx(
            [-command.roll, -command.pitch], abs=1e-9
        )  # the torso is commanded to be level
        assert (sight.velocity, sight.yaw_rate, sight.yaw) == (
            complex(command.vx, command.vy),
            command.yaw_rate,
            0.0,
        )


def test_reaching_for_missing_ground_is_told_to_the_servos_as_speed() -> None:
    """Foot 1 measures no force, the other feet carry its load."""
    controller = make(
        compliant=True,
        parts=Parts(support=False, posture=False, path=False),
    )
    measurement = Measurement(angle=controller.stance.copy())
    measurement.foot_force[:, 2] = 11.0
    measurement.foot_force[1] = 0.0
    moved = run(controller, BodyCommand(), 150, measurement=measurement)[:, :2, 1]
    slope = np.diff(moved[:, 0], axis=0) / PERIOD
    reaching = np.abs(slope).max(axis=1) > 0.0
    assert 90 < reaching.sum() < 110  # periods in 40 mm at 0.08 m/s
    np.testing.assert_allclose(moved[1:, 1][reaching][:-1], slope[reaching][:-1], rtol=1e-6)
    assert not moved[1:, 1][~reaching].any()
    assert controller.diagnostics.lift[1] < -0.039
    assert not controller.diagnostics.fallback.any()
