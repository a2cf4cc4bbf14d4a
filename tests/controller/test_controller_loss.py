"""The controller notices servos that do not work, walks without their legs and takes them back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gains import make_gains

from hexapod_cosim.controller import BodyCommand, Controller, JointCommand, Measurement, make_gait
from hexapod_cosim.controller.plane import LEGS, Mask
from hexapod_cosim.controller.sense.health import PROOF_TIME, STRANGE_TIME, Health
from hexapod_cosim.controller.walk.absence import BACK_TIME, SHIFT_TIME, Absence, gait_without
from hexapod_cosim.controller.walk.foot_paths import FootPaths
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot, load_robot

H = 0.005  # s    period
ROBOT = load_robot("athena")
SOLVER = LegSolver(ROBOT)
LF, LM, LR, RF, RM, RR = range(LEGS)


def mask(*legs: int) -> Mask:
    return np.isin(np.arange(LEGS), legs)


def steps_until_faulty(
    offset: float,
    *,
    force: float = 0.0,
    drift: float = 0.0,
    speed_ref: float | None = None,
    lifted: Mask | None = None,
    most: int = 100,
    robot: Robot = ROBOT,
) -> int:
    """Returns the steps until the femur of LF is found faulty, `most` if it is not.

    offset: of its command from its angle [rad]; force: on its foot, upwards [N]; drift: of angle
    and command [rad/s]; speed_ref: commanded [rad/s], by default none; lifted: feet that their legs
    lift, by default none.
    """
    health = Health(robot, make_gains(robot), legs=LegSolver(robot), period=H)
    command, forces, angle = JointCommand(), np.zeros((LEGS, 3)), robot.stance.copy()
    forces[LF, 2] = force
    for step in range(most):
        angle[LF, 1] += drift * H
        command.angle_ref[...] = angle
        command.angle_ref[LF, 1] += offset
        if speed_ref is not None:
            command.speed_ref[LF, 1] = speed_ref
            command.angle_ref[LF, 1] -= speed_ref * H
        health.step(angle, forces, command, mask() if lifted is None else lifted)
        if health.faulty.any():
            assert np.argwhere(health.faulty).tolist() == [[LF, 1]]
            return step + 1
    return most


def test_the_load_torques_are_those_of_virtual_work() -> None:
    generator = np.random.default_rng(1)
    angle = ROBOT.stance + 0.3 * generator.normal(size=(LEGS, 3))
    force = generator.normal(size=(LEGS, 3))
    expected = -np.einsum("kij,ki->kj", SOLVER.jacobian(angle), force)
    np.testing.assert_allclose(SOLVER.load_torques(angle, force), expected, atol=1e-12)


def test_a_servo_is_faulty_when_nothing_explains_its_torque_for_some_time() -> None:
    assert steps_until_faulty(0.10) == pytest.approx(STRANGE_TIME / H, abs=1)
    assert steps_until_faulty(0.05) == 100  # the torque of 2 N m may be an error of the model


def test_a_load_explains_a_torque() -> None:
    lever = SOLVER.load_torques(ROBOT.stance, np.tile([0.0, 0.0, 1.0], (LEGS, 1)))[LF, 1]
    assert lever == pytest.approx(-0.12, abs=1e-9)  # m    the foot's distance from its joint
    assert steps_until_faulty(-0.10, force=30.0) == 100
    assert steps_until_faulty(0.10, force=30.0) < 100


def test_a_foot_that_its_leg_lifts_bears_none_to_all_of_the_measured_force() -> None:
    """A stuck sensor of 30 N asks 3.6 N m of the femur; a stone in the way bears its force."""
    assert steps_until_faulty(0.0, force=30.0) < 100
    assert steps_until_faulty(0.0, force=30.0, lifted=mask(LF)) == 100
    assert steps_until_faulty(-0.10, force=30.0, lifted=mask(LF)) == 100
    assert steps_until_faulty(0.10, force=30.0, lifted=mask(LF)) < 100


def test_damping_by_a_commanded_speed_explains_a_torque() -> None:
    """At most 0.02 s x 40 N m/rad: of 4 N m, 2.4 are left at -2 rad/s, and 3.2 at -1 rad/s."""
    assert steps_until_faulty(0.10, speed_ref=-2.0) == 100
    assert steps_until_faulty(0.10, speed_ref=-1.0) == pytest.approx(STRANGE_TIME / H, abs=1)
    assert steps_until_faulty(0.10, speed_ref=2.0) == pytest.approx(STRANGE_TIME / H, abs=1)


def test_a_rotor_that_slows_down_explains_a_torque() -> None:
    """0.01 kg m2 at 200 rad/s2 takes 2 of 4 N m, for longer than a fault takes to be found."""
    robot = replace(ROBOT, servo=replace(ROBOT.servo, speed_max=1e3))
    health = Health(robot, make_gains(robot), legs=LegSolver(robot), period=H)
    command, forces, angle, speed = JointCommand(), np.zeros((LEGS, 3)), robot.stance.copy(), -20.0
    for _ in range(20):
        speed += 200.0 * H
        angle[LF, 1] += speed * H
        command.angle_ref[...] = angle + mask(LF)[:, None] * [0.0, 0.1, 0.0]
        command.speed_ref[LF, 1] = speed
        command.angle_ref[LF, 1] -= speed * H
        health.step(angle, forces, command)
        assert not health.lost.any()


def test_a_load_beyond_the_strength_of_the_servo_is_no_fault() -> None:
    """Of 9.6 N m that 80 N need, 5.4 count; the servo gives 4.4 of them at 0.11 rad."""
    assert steps_until_faulty(-0.11, force=80.0) == 100
    assert steps_until_faulty(0.0, force=80.0) == pytest.approx(STRANGE_TIME / H, abs=1)


def test_a_servo_gives_no_more_than_the_current_that_its_firmware_allows() -> None:
    """1.59315 A give 3.32 N m of a stall torque of 7.50 N m: half of them are unexplained."""
    robot = load_robot("sts3215_hexapod")
    assert robot.servo.torque_limit == pytest.approx(3.31633, rel=1e-5)
    assert ROBOT.servo.torque_limit == 6.0
    unlimited = replace(robot, servo=replace(robot.servo, current_max=0.0))
    assert steps_until_faulty(0.06, robot=robot) == pytest.approx(STRANGE_TIME / H, abs=1)
    assert steps_until_faulty(0.06, robot=unlimited) == 100


def test_a_firmware_leads_a_servo_to_a_far_command_no_faster_than_it_allows() -> None:
    """At 0.5 rad/s the goal needs 0.1 s for 0.05 rad, at which 2.04 of 3.32 N m are strange."""
    robot = load_robot("sts3215_hexapod")
    slow = replace(robot, servo=replace(robot.servo, goal_speed_max=0.5))
    health = Health(slow, make_gains(slow), legs=LegSolver(slow), period=H)
    command, angle = JointCommand(), slow.stance.copy()
    command.angle_ref[...] = angle
    health.step(angle, np.zeros((LEGS, 3)), command)
    command.angle_ref[LF, 1] += 1.0
    count = 0
    while not health.lost.any():
        health.step(angle, np.zeros((LEGS, 3)), command)
        count += 1
    assert count == pytest.approx((0.0407 / 0.5 + STRANGE_TIME) / H, abs=1)


def test_a_joint_that_is_as_fast_as_it_can_is_no_fault() -> None:
    """A servo gives no torque at its largest speed, however far the command is ahead."""
    assert steps_until_faulty(0.5, drift=0.9 * ROBOT.servo.speed_max) == 100


def test_the_lag_of_a_motor_behind_its_command_is_no_fault() -> None:
    """At 3 rad/s back-EMF and viscous friction take 4.07 of 7.50 N m, and the angle lags by as much
    as the firmware needs to ask for that.
    """
    robot = load_robot("sts3215_hexapod")
    assert robot.servo.drag == pytest.approx(1.356775, rel=1e-5)  # 2.08162^2/3.23107 + 0.0156896
    lag = 3.0 * robot.servo.drag / robot.servo.kp
    assert steps_until_faulty(lag, drift=3.0, robot=robot) == 100
    assert steps_until_faulty(lag, robot=robot) == pytest.approx(STRANGE_TIME / H, abs=1)


def test_a_servo_is_sound_again_when_it_has_followed_for_some_time() -> None:
    health = Health(ROBOT, make_gains(ROBOT), legs=SOLVER, period=H)
    command, forces, angle = JointCommand(), np.zeros((LEGS, 3)), ROBOT.stance.copy()
    command.angle_ref[...] = angle + mask(RR)[:, None] * [0.0, 0.0, 0.2]
    for _ in range(20):
        health.step(angle, forces, command)
    assert health.locked[RR].tolist() == [True, True, True]
    assert health.lost.tolist() == mask(RR).tolist()
    command.angle_ref[...] = angle
    count = 0
    while health.lost.any():
        health.step(angle, forces, command)
        count += 1
    assert count == pytest.approx(PROOF_TIME / H, abs=1)


@pytest.mark.parametrize(
    ("joint", "locked", "bears"), [(0, False, True), (1, False, False), (2, True, True)]
)
def test_a_leg_without_limp_femur_and_tibia_can_bear_a_load(
    joint: int, locked: bool, bears: bool
) -> None:
    health = Health(ROBOT, make_gains(ROBOT), legs=SOLVER, period=H)
    health.faulty[RR, joint], health.locked[RR, joint] = True, locked
    assert health.bearing.tolist() == (mask(RR) <= bears).tolist()


@pytest.mark.parametrize("bearing", [False, True])
def test_a_lost_leg_that_can_bear_a_load_stands_until_no_other_leg_swings(bearing: bool) -> None:
    controller = Controller(ROBOT, period=H, gait=make_gait(ROBOT), gains=make_gains(ROBOT))
    plan, out = controller.plan, JointCommand()
    plan.aim(BodyCommand(vx=0.04))
    while not ((plan.now.feet.rise < 0.0) & (plan.lift() < 0.02)).any():
        plan.advance(False)  # 0.14 s before the end of the first swings by the clock
    stands = int(np.flatnonzero(~plan.paths.clock.swinging)[0])
    able = np.full(LEGS, bearing)
    assert plan.lose(mask(stands), able, out) is not bearing
    steps, lowest = 0, np.inf
    while plan.paths.clock.swinging.any():
        assert plan.lose(mask(stands), able, out) is False
        lowest = plan.lift().max()
        plan.advance(False)
        steps += 1
    assert 0.17 < steps * H < 0.20  # ln(20/8)/10 s from 20 mm to 8 mm, then 8 mm at 0.08 m/s
    assert lowest <= 0.08 * H  # no foot jumps down when the clock says that it stands
    assert plan.lose(mask(stands), able, out) is bearing
    assert plan.absence.legs.tolist() == mask(stands).tolist()


@pytest.mark.parametrize("absent", [(LF,), (LM,), (LF, RR)])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_other_legs_walk_a_wave(absent: tuple[int, ...], backwards: bool) -> None:
    gait = gait_without(make_gait(ROBOT), mask(*absent), backwards=backwards)
    others = LEGS - len(absent)
    assert gait.duty == pytest.approx(1.0 - 1.0 / others)
    swings = [
        np.flatnonzero(~gait.stance(clock) & ~mask(*absent)).tolist()
        for clock in (np.arange(others) + 0.5) / others
    ]
    order = [leg for swing in swings for leg in swing]
    assert sorted(order) == np.flatnonzero(~mask(*absent)).tolist()  # one at a time
    wave = [leg for leg in (0, 5, 4, 3, 2, 1) if leg not in absent]
    turned = [wave[(k + wave.index(order[0])) % others] for k in range(others)]
    assert (order == turned) is not backwards


def test_the_gait_of_all_legs_is_the_own_one() -> None:
    gait = make_gait(ROBOT)
    assert gait_without(gait, mask(), backwards=False) is gait


def lost(*legs: int) -> Absence:
    foot = SOLVER.forward(ROBOT.stance)
    absence = Absence(SOLVER, foot[:, 0] + 1j * foot[:, 1], handover=0.065, period=H)
    assert absence.change(mask(*legs), JointCommand())
    return absence


@pytest.mark.parametrize(("legs", "most"), [((LF,), 0.045), ((LF, LR), 0.09)])
def test_the_torso_moves_over_the_other_feet_and_the_walk_takes_it_back(
    legs: tuple[int, ...], most: float
) -> None:
    absence = lost(*legs)
    others = absence.home[~mask(*legs)].mean()
    others *= most / abs(others)  # as far as the legs' reach allows
    assert absence.torso(0) == 0.0
    assert absence.torso(round(SHIFT_TIME / H)) == pytest.approx(others)
    way = H * sum(absence.drift(k) for k in range(round((SHIFT_TIME + BACK_TIME) / H) + 1))
    assert way == pytest.approx(-others, rel=1e-4)


def test_a_lost_leg_gives_up_its_load_smoothly_and_others_keep_theirs() -> None:
    absence = lost(LM)
    share = np.array([absence.presence(k) for k in range(20)])
    assert share[0, LM] == 1.0
    assert share[-1, LM] == 0.0
    assert np.diff(share[:, LM]).max() <= 0.0
    assert -np.diff(share[:, LM]).min() < 0.13
    assert (np.delete(share, LM, axis=1) == 1.0).all()


def test_four_legs_remain_in_service() -> None:
    absence = lost(LF)
    assert absence.change(mask(LF, LM, RR), JointCommand())
    assert absence.legs.tolist() == mask(LF, LM).tolist()
    assert not absence.change(mask(LF, LM, RR), JointCommand())


@pytest.mark.parametrize("law", ["compliant", "paper"])
def test_a_leg_that_does_not_move_is_folded_and_comes_back_without_a_jump(law: str) -> None:
    """The joints give way to their loads at once. Those of LM rest from 2 s to 5 s."""
    controller = Controller(
        ROBOT, period=H, gait=make_gait(ROBOT), gains=make_gains(ROBOT), law=law
    )
    measurement = Measurement(angle=ROBOT.stance.copy())
    absent, angles = [], []
    for k in range(2000):
        out = controller.step(k * H, BodyCommand(vx=0.04), measurement)
        resting = measurement.angle[LM].copy()
        support = ~controller.diagnostics.swinging & ~controller.diagnostics.absent
        measurement.foot_force[:, 2] = np.where(support, ROBOT.weight / support.sum(), 0.0)
        load = SOLVER.load_torques(out.angle_ref, measurement.foot_force)
        measurement.angle[...] = out.angle_ref + (out.torque_ref - load) / ROBOT.servo.kp
        if 400 <= k < 1000:
            measurement.angle[LM] = resting
        absent.append(controller.diagnostics.absent.copy())
        angles.append(out.angle_ref.copy())
    gone = np.flatnonzero(np.array(absent)[:, LM])
    assert not np.delete(absent, LM, axis=1).any()
    assert 400 < gone[0] < 600  # within a gait cycle
    assert 1000 + PROOF_TIME / H <= gone[-1] < 1600
    steps = np.abs(np.diff(np.delete(angles, LM, axis=1), axis=0))
    assert steps[gone[0] - 1 : gone[0] + 100].max() < 0.05
    assert steps[gone[-1] - 100 : gone[-1] + 100].max() < 0.05
    assert controller.gait == make_gait(ROBOT)


@pytest.mark.parametrize(
    ("absent", "backwards", "first"),
    [(LF, False, LR), (RF, False, RR), (LM, False, RM), (RR, False, LF), (LR, True, LF)],
)
def test_a_wave_begins_with_the_leg_that_lets_the_feet_beside_the_torso_step_early(
    absent: int, backwards: bool, first: int
) -> None:
    """It is the rearmost leg on the side of a lost foremost one, else the one opposite."""
    gait = gait_without(make_gait(ROBOT), mask(absent), backwards=backwards)
    paths = FootPaths(gait, SOLVER, period=H)
    feet = paths.reset()
    paths.clock.walking, paths.clock.absent = True, mask(absent)
    paths.join(feet)
    until = (gait.duty + 1e-6 - paths.clock.phase_after(0)) % 1.0  # cycles    to the lift-off
    assert int(np.argmin(np.where(mask(absent), np.inf, until))) == first
