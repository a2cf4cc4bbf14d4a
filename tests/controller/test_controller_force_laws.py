"""Tests compliant control and how it uses its sensors: axes of forces,
positions of feet, doubtful readings.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from controllers import make, obey, squeezed
from controllers import run as run_controller
from gains import PERIOD, make_gains
from standing import GAINS, ROBOT, WEIGHT, make_laws, plan, rest, run, shared, squeezing
from twin_motion import HIGH, Motion, Z, velocities

from hexapod_cosim.controller import BodyCommand, Measurement, Parts
from hexapod_cosim.controller.comply.compliant import sense
from hexapod_cosim.controller.gains import LimitGains
from hexapod_cosim.controller.walk.hold import HoldInput
from hexapod_cosim.models import Robot
from hexapod_cosim.models.kinematics import axis_quaternion, foot_centres, quaternion_product

NO_LIMITS = Parts(limits=False)
ONLY_1 = np.arange(6) == 1


def contact_jacobians(robot: Robot) -> np.ndarray:
    """Returns the Jacobians (6, 3, 3) of the contact points in the stance, by the twin."""
    still = np.zeros((1, 6, 3))
    motion = Motion(
        PERIOD, np.zeros(1, dtype=complex), np.zeros(1), np.zeros((1, 3)), robot.stance[None], still
    )
    body = motion.bodies(robot, 0)
    reach, found = velocities(robot, body, robot.stance).reshape(19, 6, 24), []
    for leg, centre in enumerate(foot_centres(robot, body)):
        v, w = np.split(reach[3 * leg + 3, :, 6 + 3 * leg : 9 + 3 * leg], 2)
        found.append(v + np.cross(w.T, centre - robot.foot.radius * Z - body[3 * leg + 3, :3]).T)
    assert body[0, 2] >= HIGH
    return np.array(found)


@pytest.mark.parametrize("missing", [0.0, 0.3, 1.0])
def test_the_held_share_of_the_planned_squeeze_is_what_creep_leaves_of_it(missing: float) -> None:
    """A push of all feet and a squeeze that is not planned do not count; the share is smoothed."""
    laws = make_laws(parts=Parts(touchdown=False, fallback=False))
    plan(laws)
    planned = np.array([2.0, -1.0, -1.0, 2.0, -1.0, -1.0], dtype=np.complex128)
    shares = laws.planned.shares
    shares = shares._replace(push=shares.push + planned, squeeze=planned)
    laws.planned = laws.planned._replace(shares=shares)
    laws.scale = 1.0
    force = shares.forces()
    left = (1.0 - missing) * planned + 1j * np.array([1.0, 0.0, -1.0, 0.0, 0.0, 0.0]) + 0.5
    force[:, 0] += (left - planned).real
    force[:, 1] += left.imag
    for k in range(1, 60):
        laws.feel(force)
        grown = 1.0 - math.exp(-k * PERIOD / ROBOT.gait.period)
        assert laws.squeeze_share == pytest.approx(1.0 - missing * grown)


@pytest.mark.parametrize(("share", "waits"), [(0.19, True), (0.21, False)])
def test_the_clock_waits_until_a_foot_bears_a_fifteenth_of_the_weight_at_this_moment(
    share: float, waits: bool
) -> None:
    """C50: the force counts as it is, not the smoothed load, which would be late."""
    laws = make_laws(parts=Parts(fallback=False))
    plan(laws, standing="101111")
    laws.planned = laws.planned._replace(awaited=ONLY_1)
    force = shared(laws)
    force[1, 2] = share * WEIGHT / 3.0
    laws.feel(force)
    assert laws.contact[1]
    assert laws.load[1] < 0.05
    assert laws.waits(ONLY_1, waiting=True) == waits
    assert not laws.waits(ONLY_1, waiting=False)  # it does not begin to wait for it


@pytest.mark.parametrize("payload", [0.8, 1.0, 1.35])
def test_the_support_grows_into_the_measured_weight_whatever_the_robot_carries(
    payload: float,
) -> None:
    laws = make_laws()
    plan(laws)
    force = payload * shared(laws)
    carry, own = laws.planned.carry, laws.planned.own
    for k in range(1, 400):
        laws.feel(force)
        grown = payload * (1.0 - math.exp(-k * PERIOD / GAINS.support.weight_time))
        assert laws.scale == pytest.approx(grown)
        np.testing.assert_allclose(laws.torque, own + grown * carry, atol=1e-12)


def test_the_torques_carry_the_shares_and_the_legs() -> None:
    """The torques of the stance are the links' gravity and -J^T of the shares."""
    laws = make_laws(parts=NO_LIMITS)
    plan(laws)
    force = shared(laws)
    for _ in range(3000):
        laws.feel(force)
    still = np.einsum("lba,lb->la", contact_jacobians(ROBOT), force)
    np.testing.assert_allclose(laws.torque, rest(ROBOT).torque - still, atol=1e-4)


def test_torques_keep_their_limit() -> None:
    free, bound = (
        make_laws(parts=NO_LIMITS),
        make_laws(gains=replace(GAINS, limits=LimitGains(torque=0.3))),
    )
    for laws in (free, bound):
        run(laws, squeezing(6.0), 120)
    assert np.abs(bound.torque).max() <= 0.3
    assert np.abs(free.torque).max() > 0.3


def test_without_its_parts_nothing_is_corrected() -> None:
    laws = make_laws(parts=Parts(support=False, touchdown=False, fallback=False))
    run(laws, squeezing() * [1.0, 1.0, 1.4], 50)
    assert not laws.torque.any()
    assert not laws.touchdown.offset.any()


@pytest.mark.parametrize("shifted", [0.0, 0.1, 0.6])
def test_a_foot_whose_force_is_not_believed_bears_the_load_that_the_others_leave(
    shifted: float,
) -> None:
    """shifted: share of its load that the other feet bear, when it stands on lower ground."""
    laws, dead = make_laws(gains=make_gains(ROBOT)), squeezing(0.0)
    run(laws, dead, 1000)
    dead[1] = 0.0
    run(laws, dead, 50)
    dead[:, 2] *= 1.0 + shifted / 5.0
    run(laws, dead, 100)
    assert laws.doubted.tolist() == [False, True, False, False, False, False]
    assert laws.contact.all()
    assert laws.load[1] == pytest.approx(0.5 * (1.0 - shifted), rel=0.02)
    assert laws.scale == pytest.approx(1.0, rel=1e-4)  # that before the sensor failed
    assert not laws.fallback.any()


def test_a_foot_whose_force_is_not_believed_and_bears_no_load_is_in_the_air() -> None:
    laws, dead = make_laws(gains=make_gains(ROBOT)), squeezing(0.0)
    run(laws, dead, 1000)
    dead[1] = 0.0
    run(laws, dead, 50)
    dead[:, 2] *= 6.0 / 5.0
    plan(laws, standing="101111")
    for _ in range(10):
        laws.feel(dead)
    run(laws, dead, 50)
    assert laws.contact.tolist() == [True, False, True, True, True, True]
    assert laws.touchdown.offset[1] < -0.015  # m    it searches for the ground


def test_from_three_wrong_forces_on_all_are_replaced_by_the_plans() -> None:
    laws, dead = make_laws(gains=make_gains(ROBOT)), squeezing(0.0)
    run(laws, dead, 400)
    dead[[1, 3, 5]] = 0.0
    run(laws, dead, 100)
    assert laws.doubted.all()
    assert laws.load == pytest.approx(laws.planned.shares.normal * 3.0 / WEIGHT, rel=0.02)


def test_a_sliding_robot_goes_over_to_kinematic_control_and_back_once_it_holds() -> None:
    """All feet drag with more than half of their loads.

    The torques then contain no shares, and every leg reports fallback.
    """
    laws, calm, sliding = make_laws(), squeezing(), squeezing()
    sliding[:, 0] = -0.6 * WEIGHT / 6.0
    run(laws, calm, 400)
    carried = np.abs(laws.torque).max()
    assert not laws.fallback.any()
    run(laws, sliding, 60)
    assert laws.fallback.all()
    assert not laws.doubted.any()
    assert np.abs(laws.torque).max() < 0.02 * carried
    run(laws, calm, 400)
    assert not laws.fallback.any()
    assert np.abs(laws.torque).max() == pytest.approx(carried, rel=0.05)
    deaf = make_laws(parts=Parts(fallback=False))
    run(deaf, calm, 400)
    run(deaf, sliding, 60)
    assert np.abs(deaf.torque).max() > 0.5 * carried


def steps_until_fallback(drag: float, total: float) -> int:
    """Returns the periods until kinematic control, 0 for never.

    Each foot drags by the share `drag` of its load; all feet carry the share `total` of the weight.
    """
    laws, force = make_laws(), squeezing(0.0)
    run(laws, force, 400)
    force[:, 2] *= total
    force[:, 0] = drag * force[:, 2]
    plan(laws)
    for count in range(1, 101):
        laws.feel(force)
        if laws.fallback.all():
            return count
    return 0


@pytest.mark.parametrize(
    ("drag", "total", "count"),
    [(0.54, 1.0, 0), (0.56, 1.0, 9), (0.56, 0.51, 9), (0.56, 0.49, 0), (1.0, 1.0, 9)],
)
def test_a_robot_slides_when_loaded_feet_drag_by_55_percent_for_40_milliseconds(
    drag: float, total: float, count: int
) -> None:
    """At a period of 5 ms, 40 ms are eight periods; the ninth is longer."""
    assert steps_until_fallback(drag, total) == count


def test_a_leg_that_should_stand_and_does_not_is_given_no_share_until_it_does() -> None:
    laws, force = make_laws(parts=Parts(fallback=False)), squeezing(0.0)
    run(laws, force, 400)
    full = laws.torque.copy()
    off = force.copy()
    off[2] = 0.0
    run(laws, off, 1)
    own = rest(ROBOT).torque
    np.testing.assert_allclose(laws.torque[2], own[2], atol=1e-9)
    assert np.abs(laws.torque - own)[1].max() > 0.3
    run(laws, force, 60)
    np.testing.assert_allclose(laws.torque[2], full[2], rtol=0.05)


# Tests how compliant control uses its sensors: axes of forces, positions of feet, wrong sensors.


def test_the_forces_on_a_torso_that_leans_as_commanded_are_judged_upright() -> None:
    roll, pitch = 0.2, -0.15
    controller, measurement = make(compliant=True), squeezed()
    pitched, rolled = (
        axis_quaternion(np.array([0.0, 1.0, 0.0]), pitch),
        axis_quaternion(np.array([1.0, 0.0, 0.0]), roll),
    )
    measurement.quaternion[:] = quaternion_product(pitched, rolled)
    run_controller(controller, BodyCommand(roll=roll, pitch=pitch), 300, measurement=measurement)
    compliant = controller.compliant
    assert compliant is not None
    np.testing.assert_allclose(
        sense(measurement, compliant.present.posture), measurement.foot_force, atol=1e-12
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
    controller, seen = (
        make(compliant=True, parts=Parts(path=False, posture=False)),
        list[HoldInput](),
    )
    assert controller.compliant is not None
    monkeypatch.setattr(controller.compliant.hold, "update", seen.append)
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
    controller = make(compliant=True, parts=Parts(support=False, posture=False, path=False))
    measurement = Measurement(angle=controller._out.angle_ref)  # the joints follow at once
    measurement.foot_force[:, 2] = 11.0
    measurement.foot_force[1] = 0.0
    moved = run_controller(controller, BodyCommand(), 150, measurement=measurement)[:, :2, 1]
    slope = np.diff(moved[:, 0], axis=0) / PERIOD
    reaching = np.abs(slope).max(axis=1) > 0.0
    assert 90 < reaching.sum() < 110  # periods in 40 mm at 0.08 m/s
    np.testing.assert_allclose(moved[1:, 1][reaching][:-1], slope[reaching][:-1], rtol=1e-6)
    assert not moved[1:, 1][~reaching].any()
    assert controller.diagnostics.lift[1] < -0.039
    assert not controller.diagnostics.fallback.any()
