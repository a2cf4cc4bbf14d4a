"""Tests what the measured forces do to the joints of a standing robot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, make_gains, weight
from standing import GAINS, HOME, ROBOT, WEIGHT, Laws, make_laws, plan, rest, run, shared, squeezing
from twin_motion import HIGH, Motion, Z, velocities

from hexapod_cosim.controller import Gains, Parts
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.kinematics import foot_centres

ROUND_OFF = 1e-9  # N
NO_LIMITS = Parts(suspension=True, limits=False)
ONLY_SLIP = Parts(suspension=False, support=False, touchdown=False, fallback=False, limits=False)
ONLY_SUSPENSION = Parts(
    suspension=True, slip_pid=False, support=False, touchdown=False, fallback=False, limits=False
)


def slip_gains(**changes: float) -> Gains:
    return replace(GAINS, slip=replace(GAINS.slip, **changes))


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


def stuck_forces(robot: Robot, laws: Laws) -> np.ndarray:
    """Returns the change (6, 3) of the ground's forces on feet that stick.

    The joints cannot move, so kp bend = -J^T f.
    """
    torque = robot.servo.kp * laws.bend
    return np.array(
        [
            np.linalg.solve(jacobian.T, -tau)
            for jacobian, tau in zip(contact_jacobians(robot), torque, strict=True)
        ]
    )


def test_a_common_push_is_left_alone() -> None:
    laws, force = make_laws(parts=ONLY_SLIP), squeezing(0.0)
    force[:, 2] *= [0.5, 1.0, 1.5, 0.5, 1.0, 1.5]
    force[:, :2] = 0.3 * force[:, 2:3] * [1.0, -0.5]
    run(laws, force, 40)
    assert np.abs(laws.answer).max() < ROUND_OFF
    assert np.abs(laws.bend).max() < 1e-12


def test_a_common_twist_about_the_feets_centre_of_load_is_left_alone() -> None:
    laws, force = make_laws(parts=ONLY_SLIP), squeezing(0.0)
    force[:, 2] *= [0.5, 1.0, 1.5, 0.5, 1.0, 1.5]
    arm = HOME - force[:, 2] @ HOME / force[:, 2].sum()
    twist = 3.0j * force[:, 2] / WEIGHT * arm / abs(arm).max() + (0.2 - 0.1j) * force[:, 2]
    force[:, :2] = np.column_stack([twist.real, twist.imag])
    run(laws, force, 40)
    assert np.abs(laws.answer).max() < ROUND_OFF
    assert np.abs(laws.bend).max() < 1e-12


def test_squeezing_is_given_way_to_and_adds_up_to_nothing() -> None:
    laws = make_laws(parts=ONLY_SLIP)
    run(laws, squeezing() + np.array([0.1, 0.2, 0.0]), 10)
    answer = laws.answer
    assert answer[1, 1] > 0.1 > -0.1 > answer[4, 1]
    assert np.abs(answer.sum(axis=0)).max() < ROUND_OFF
    assert abs((HOME.conj() * (answer @ [1.0, 1.0j])).imag.sum()) < ROUND_OFF
    assert np.abs(answer[[0, 2, 3, 5]]).max() < ROUND_OFF
    assert laws.shift[1, 1] > 0.0 > laws.shift[4, 1]  # the feet yield to the force


def test_a_foot_that_measures_nothing_pushes_nothing() -> None:
    laws, force = make_laws(parts=ONLY_SLIP), squeezing(0.0)
    force[3] = [5.0, 5.0, 0.004 * WEIGHT]
    run(laws, force, 10)
    assert not laws.answer.any()


@pytest.mark.parametrize("direction", [0.0, 0.7, 1.6, 2.5])
@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_a_foot_that_sticks_answers_with_exactly_the_pids_force_and_none_upwards(
    name: str, direction: float
) -> None:
    robot = load_robot(name)
    laws, force = make_laws(robot, parts=ONLY_SLIP), np.zeros((6, 3))
    force[:, 2] = weight(robot) / 6.0
    force[:, :2] = np.outer(
        [1.0, -1.0, 2.0, 0.5, -3.0, 0.5], [math.cos(direction), math.sin(direction)]
    )
    run(laws, force, 15, robot=robot)
    assert np.abs(laws.answer).min() > 0.0 or direction == 0.0
    answered = laws.answer * laws.law.load[:, None]
    np.testing.assert_allclose(
        stuck_forces(robot, laws), np.column_stack([-answered, np.zeros(6)]), atol=ROUND_OFF
    )


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_the_suspension_lifts_by_its_deflection_and_pushes_a_foot_that_sticks_downwards_only(
    name: str,
) -> None:
    robot = load_robot(name)
    laws = make_laws(robot, parts=ONLY_SUSPENSION)
    plan(laws, robot=robot)
    laws.scale = 1.0
    force = shared(laws)
    force[2, 2] += 5.0
    force[3, 2] -= 3.0
    for _ in range(40):
        laws.feel(force)
    np.testing.assert_allclose(laws.shift[:, 2], laws.law.deflection, atol=1e-12)
    assert laws.law.deflection[2] > 0.0 > laws.law.deflection[3]
    stuck = stuck_forces(robot, laws)
    assert np.abs(stuck[:, :2]).max() < ROUND_OFF
    assert stuck[2, 2] < 0.0 < stuck[3, 2]  # the leg carries less because it carried too much


def test_at_its_share_the_suspension_rests_and_beyond_it_gives_way_by_force_over_stiffness() -> (
    None
):
    laws, payload = make_laws(parts=ONLY_SUSPENSION), 1.2
    plan(laws)
    laws.scale, force = payload, payload * shared(laws)
    force[2, 2] += 4.0
    force[0, 2] -= 4.0
    for _ in range(2000):
        laws.feel(force)
    np.testing.assert_allclose(
        laws.law.deflection,
        np.array([-4.0, 0.0, 4.0, 0.0, 0.0, 0.0]) / GAINS.suspension.stiffness,
        atol=1e-9,
    )


def test_feet_without_a_share_have_no_suspension() -> None:
    laws, force = make_laws(parts=replace(ONLY_SUSPENSION, touchdown=False)), squeezing(0.0)
    run(laws, force, 50, standing="101010", height=0.001)
    assert not laws.law.deflection[[1, 3, 5]].any()
    assert laws.law.deflection[[0, 2, 4]].any()


@pytest.mark.parametrize(("sign", "low", "high"), [(1.0, 0.0, 0.4), (-1.0, 1.1, np.inf)])
def test_giving_way_takes_the_slip_from_legs_that_squeeze_and_resisting_adds_to_it(
    sign: float, low: float, high: float
) -> None:
    """Simulates two legs whose paths drift apart: f = -c x', leg f = (x - path - shift)/C, by
    backward Euler.

    Compares the distances that the feet slip with the law and without.
    """
    compliance = (contact_jacobians(ROBOT)[1] @ contact_jacobians(ROBOT)[1].T / ROBOT.servo.kp)[
        1, 1
    ]  # m/N
    creep, drift = ROBOT.friction.mu * ROBOT.friction.slope * WEIGHT / 6.0, 0.01  # N s/m, m/s
    slips = []
    for gain in (0.0, sign):
        laws, force, f, x, path, slid = (
            make_laws(parts=ONLY_SLIP),
            squeezing(0.0),
            0.0,
            0.0,
            0.0,
            0.0,
        )
        plan(laws)
        for _ in range(100):
            force[1, 1], force[4, 1] = f, -f
            laws.feel(force)
            path += drift * PERIOD
            x_next = (x * creep / PERIOD + (path + gain * laws.shift[1, 1]) / compliance) / (
                creep / PERIOD + 1.0 / compliance
            )
            f, slid, x = -creep * (x_next - x) / PERIOD, slid + abs(x_next - x), x_next
        slips.append(slid)
    assert low < slips[1] / slips[0] < high


@pytest.mark.parametrize("load", [0.3, 1.0, 1.9, 2.5])
def test_the_answer_goes_with_the_measured_load_up_to_what_the_loop_bears(load: float) -> None:
    laws, force = make_laws(parts=ONLY_SLIP), squeezing()
    force[:, 2] = load * WEIGHT / 3.0
    run(laws, force, 100)
    np.testing.assert_allclose(laws.law.load, load, rtol=1e-6)
    expected = laws.answer * min(load, 2.0)
    np.testing.assert_allclose(-stuck_forces(ROBOT, laws)[:, :2], expected, atol=ROUND_OFF)


def test_a_foot_in_the_air_forgets_and_others_do_not() -> None:
    laws = make_laws(parts=ONLY_SLIP)
    run(laws, squeezing(), 60)
    before, force = laws.integral, squeezing(0.0)
    force[1] = 0.0
    run(laws, squeezing(), 1, standing="101111")  # planned to swing, but still on the ground
    assert laws.integral[1, 1] > before[1, 1]
    for _ in range(30):
        laws.law.pid.force = laws.law.pid.smooth = np.zeros(
            6, dtype=np.complex128
        )  # the filter's state, which follows the force
        before = laws.integral
        run(laws, force, 1, standing="101111")
        fade = math.exp(-PERIOD / GAINS.slip.load_time)
        assert laws.integral[1, 1] == pytest.approx(before[1, 1] * fade)
        np.testing.assert_allclose(laws.integral[4], before[4])


def test_the_answer_is_clamped_in_length_with_its_direction_kept() -> None:
    laws, force = make_laws(gains=slip_gains(limit=0.1), parts=ONLY_SLIP), squeezing()
    force[:, :2] = 0.0
    direction = np.array([HOME[0].real, HOME[0].imag]) / abs(
        HOME[0]
    )  # two feet that face each other, which squeeze along the line between them
    force[0, :2], force[5, :2] = 5.0 * direction, -5.0 * direction
    run(laws, force, 400)
    np.testing.assert_allclose(laws.answer[0], 0.1 * WEIGHT / 3.0 * direction, rtol=1e-9)
    assert np.abs(laws.answer[1]).max() < ROUND_OFF


def test_back_calculation_frees_the_answer_soon_after_the_force_turns() -> None:
    counts = []
    for tracking in (GAINS.slip.tracking_time, 1e9):
        laws = make_laws(gains=slip_gains(limit=0.1, tracking_time=tracking), parts=ONLY_SLIP)
        run(laws, squeezing(5.0), 200)
        plan(laws)
        counts.append(0)
        while laws.answer[1, 1] > 0.0 and counts[-1] < 1000:
            laws.feel(squeezing(-5.0))
            counts[-1] += 1
    assert (
        counts[0] < 0.1 / PERIOD
    )  # integrating back from the limit takes 0.02 s, the filter another 0.02 s
    assert counts[1] > 150


def test_the_suspension_stops_at_its_limit_and_comes_back_at_once() -> None:
    laws, force = make_laws(parts=ONLY_SUSPENSION), squeezing(0.0)
    plan(laws)
    laws.scale = 1.0
    force[2, 2] += 40.0 * GAINS.suspension.limit / 0.003
    for _ in range(100):
        laws.feel(force)
    assert laws.law.deflection[2] == GAINS.suspension.limit
    assert laws.law.rate[2] == 0.0
    force[2, 2] = WEIGHT / 6.0
    laws.feel(force)
    laws.feel(force)
    assert laws.law.deflection[2] < GAINS.suspension.limit


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


def test_no_weight_is_believed_beyond_reason() -> None:
    for size, believed in ((0.1, 0.5), (2.9, 2.9), (5.0, 3.0)):
        laws = make_laws()
        plan(laws)
        force = size * shared(laws)
        for _ in range(2000):
            laws.feel(force)
        assert laws.scale == pytest.approx(believed, rel=1e-6)


def test_the_torques_carry_the_shares_and_the_legs_without_any_bend() -> None:
    """Apart from kp bend, the torques of the stance are the links' gravity and -J^T of
    the shares.
    """
    laws = make_laws(parts=NO_LIMITS)
    plan(laws)
    force = shared(laws)
    for _ in range(3000):
        laws.feel(force)
    still = np.einsum("lba,lb->la", contact_jacobians(ROBOT), force)
    np.testing.assert_allclose(laws.torque, rest(ROBOT).torque - still, atol=1e-4)
    assert (
        np.abs(laws.bend).max() < 1e-3
    )  # rad; deflection of the suspension while the support grew


def test_corrections_keep_their_rate_and_torques_their_limit() -> None:
    slow = replace(GAINS, limits=replace(GAINS.limits, speed=0.05, torque=0.3))
    free, bound = make_laws(parts=NO_LIMITS), make_laws(gains=slow)
    for laws in (free, bound):
        plan(laws)
    largest = 0.0
    for k in range(120):
        before = bound.bend.copy(), free.bend.copy()
        for laws in (free, bound):
            laws.feel(squeezing(6.0 if k % 60 < 30 else -6.0))
        assert np.abs(bound.bend - before[0]).max() <= 0.05 * PERIOD * (1.0 + 1e-9)
        assert np.abs(bound.torque).max() <= 0.3
        largest = max(largest, float(np.abs(free.bend - before[1]).max()))
    assert largest > 0.05 * PERIOD
    assert np.abs(free.torque).max() > 0.3


def test_without_its_parts_nothing_is_corrected() -> None:
    laws = make_laws(
        parts=Parts(
            support=False, slip_pid=False, suspension=False, touchdown=False, fallback=False
        )
    )
    run(laws, squeezing() * [1.0, 1.0, 1.4], 50)
    assert not laws.bend.any()
    assert not laws.torque.any()
    assert not laws.shift.any()


def test_a_force_not_believed_is_replaced_by_the_plans_and_from_three_on_all_are() -> None:
    """One wrong force is replaced by the planned one; with three or more wrong forces all are
    replaced.
    """
    laws, dead, spike = make_laws(gains=make_gains(ROBOT)), squeezing(0.0), squeezing(0.0)
    run(laws, dead, 400)
    dead[1] = 0.0
    run(laws, dead, 50)
    assert laws.doubted.tolist() == [False, True, False, False, False, False]
    assert laws.law.load[1] == pytest.approx(
        laws.scale * laws.planned.shares.normal[1] * 3.0 / WEIGHT, rel=0.02
    )
    assert laws.scale == pytest.approx(1.0, abs=0.05)
    dead[[3, 5]] = 0.0
    run(laws, dead, 50)
    assert laws.doubted.all()
    spike[0, :2] = 6.0
    run(laws, spike, 20)
    assert np.abs(laws.answer).max() < 1e-3


def test_saved_laws_go_on_bit_for_bit() -> None:
    laws, noise = make_laws(), np.random.default_rng(3).normal(size=(120, 6, 3)) * [1.0, 1.0, 3.0]
    dead = squeezing() * np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])[:, None]
    plan(laws)

    def go_on() -> np.ndarray:
        found = []
        for shake in noise[60:]:
            laws.feel(dead + 0.3 * shake)
            found.append(
                np.column_stack(
                    [
                        laws.bend,
                        laws.torque,
                        laws.answer,
                        laws.integral,
                        laws.law.deflection,
                        laws.touchdown.offset,
                        laws.doubted,
                    ]
                )
            )
        return np.array(found)

    for shake in noise[:60]:
        laws.feel(dead + shake)
    state = laws.save()
    first = go_on()
    laws.restore(state)
    np.testing.assert_array_equal(go_on(), first)
    assert first[:, 2, -1].any()


def test_a_sliding_robot_goes_over_to_kinematic_control_and_back_once_it_holds() -> None:
    """All feet drag with more than half of their loads.

    The torques then contain neither shares nor answers of the slip PID, and every leg reports
    fallback.
    """
    laws, calm, sliding = make_laws(), squeezing(), squeezing()
    sliding[:, 0] = -0.6 * WEIGHT / 6.0
    run(laws, calm, 400)
    carried, bent = np.abs(laws.torque).max(), np.abs(laws.bend).max()
    assert bent > 0.0
    assert not laws.fallback.any()
    run(laws, sliding, 60)
    assert laws.fallback.all()
    assert not laws.doubted.any()
    assert np.abs(laws.torque).max() < 0.02 * carried
    assert np.abs(laws.bend).max() < 0.02 * bent
    run(laws, calm, 400)
    assert not laws.fallback.any()
    assert np.abs(laws.torque).max() == pytest.approx(carried, rel=0.05)
    deaf = make_laws(parts=Parts(fallback=False))
    run(deaf, calm, 400)
    run(deaf, sliding, 60)
    assert np.abs(deaf.torque).max() > 0.5 * carried


@pytest.mark.parametrize(("carried", "falls_back"), [(0.45, False), (0.55, True)])
def test_feet_that_carry_less_than_half_the_weight_together_tell_no_slide(
    carried: float, falls_back: bool
) -> None:
    """Such feet have only just met the ground and may skid."""
    laws, sliding = make_laws(), squeezing(0.0)
    run(laws, squeezing(0.0), 400)
    sliding[:, 2] *= carried
    sliding[:, 0] = -0.6 * sliding[:, 2]
    run(laws, sliding, 12)
    assert (laws.trust < 1.0) is falls_back


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


def test_feet_are_trusted_again_half_a_cycle_after_the_last_slide() -> None:
    laws, calm, sliding = make_laws(), squeezing(0.0), squeezing(0.0)
    sliding[:, 0] = 0.6 * sliding[:, 2]
    run(laws, calm, 400)
    run(laws, sliding, 20)
    plan(laws)
    count = 0
    while laws.fallback.all():
        laws.feel(calm)
        count += 1
    assert count == pytest.approx(0.5 * ROBOT.gait.period / PERIOD, abs=1)
    while laws.trust < 1.0:
        laws.feel(calm)
        count += 1
    # trust rises by 1 - e^(-t/load_time), here to 0.99; from the first step of the rise on no foot
    # reports fallback
    assert count == pytest.approx(
        0.5 * ROBOT.gait.period / PERIOD + math.log(100.0) * GAINS.slip.load_time / PERIOD, abs=1
    )


@pytest.mark.parametrize(("part", "doubted"), [(0.24, False), (0.26, True)])
def test_a_force_on_a_foot_is_doubted_from_a_quarter_of_the_step_height_on(
    part: float, doubted: bool
) -> None:
    laws, force = make_laws(), squeezing(0.0)
    run(laws, force, 40, standing="101111", height=part * ROBOT.gait.step_height)
    assert laws.doubted.tolist() == [False, doubted, False, False, False, False]


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


def test_a_robot_that_outruns_its_joints_goes_over_to_kinematic_control() -> None:
    """The criterion is the share of time in which a joint exceeds its speed, smoothed over a gait
    cycle. Control becomes compliant again when the share falls.
    """
    laws, force = make_laws(), squeezing()
    run(laws, force, 400)
    for share, lagging in ((0.4, False), (0.5, True), (0.4, True), (0.3, False)):
        for cycle in range(12):
            for k in range(100):
                plan(laws, overspeed=k % 10 < round(10 * share))
                laws.feel(force)
            assert cycle < 6 or laws.lagging is lagging
        assert bool(laws.fallback.all()) is lagging


@pytest.mark.parametrize(("share", "awaited"), [(0.1, True), (0.3, False)])
def test_a_foot_in_the_air_is_awaited_unless_joints_are_too_slow_for_a_fifth_of_the_time(
    share: float, awaited: bool
) -> None:
    laws, force, landing = make_laws(), squeezing(), np.arange(6) == 2
    force[2] = 0.0
    for k in range(600):
        plan(laws, standing="110111", overspeed=k % 10 < round(10 * share))
        laws.feel(force)
    assert laws.waits(landing, held=False) is awaited
