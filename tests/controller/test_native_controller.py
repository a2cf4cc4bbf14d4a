"""Compares the C controller with the Python controller over whole walks: the same commands under
the same measurements, to round-off.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, make_gains
from native_controller import COMMANDS, HxControllerInput, NativeController, NativeError, commands
from scipy.linalg import expm

from hexapod_cosim.controller import (
    SWITCHES,
    BodyCommand,
    Controller,
    Gait,
    LegSolver,
    Measurement,
    Parts,
    make_gait,
)
from hexapod_cosim.controller.comply.slip_pid import squeeze
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.models import load_robot

ROBOTS = ("athena", "phantomx_mk4")
ALL_PARTS = Parts(suspension=True)
EVERY_PART = replace(ALL_PARTS, slow_landing=True, sway=True, minmax_torque=True)
NO_FALLBACK = replace(ALL_PARTS, fallback=False)
ANGLE = 1e-12  # rad
SPEED = 1e-12  # relative to a servo's largest speed
# relative to a servo's largest torque. The last bits of the paths change second differences by
# 4e-16 m/h^2 = 2e-11 m/s2. Times the robot's mass and the legs' length that is about 1e-12 N m in
# either controller, for servos of 3 and 6 N m.
TORQUE = 3e-12
ACCELERATION = (
    # relative to the acceleration that reverses a servo's largest speed within a period; also a
    # second difference
    3e-12
)
LIMITS = (ANGLE, SPEED, TORQUE, ACCELERATION)
STEPS = 2000  # a walk of 10 s
Sense = Callable[[Controller, int, Measurement], None]


def setup_of(
    name: str = "athena",
    gait: str | Gait | None = None,
    *,
    compliant: bool = True,
    parts: Parts | None = None,
) -> ControllerSetup:
    robot = load_robot(name)
    timing = gait if isinstance(gait, Gait) else make_gait(robot, gait)
    gains = make_gains(robot) if compliant else None
    return ControllerSetup(
        robot=robot, gait=timing, period=PERIOD, gains=gains, parts=parts or ALL_PARTS
    )


def program(t: float) -> BodyCommand:
    """Returns the command: straight on, all six components at once during a ramp and a swing,
    turning on the spot, stop.
    """
    if t < 3.0:
        return BodyCommand(vx=0.04)
    if t < 3.3:
        return BodyCommand(0.02, -0.01, 0.05)
    if t < 6.0:
        return BodyCommand(0.02, 0.015, 0.08, 0.008, 0.04, -0.03)
    return BodyCommand(yaw_rate=0.1) if t < 8.0 else BodyCommand()


class Ground:
    """Provides forces and angles as planned, plus noise that acts on every law.

    The same seed gives the same noise.
    """

    def __init__(self, *, noise: float = 0.1) -> None:
        self.generator, self.noise = np.random.default_rng(3), noise

    def __call__(self, controller: Controller, step: int, measurement: Measurement) -> None:
        compliant, draw = controller.compliant, self.generator.normal
        if compliant is None:
            return
        planned = compliant.stance.plan.shares.forces()
        measurement.foot_force[:] = planned * (
            1.0 + self.noise * draw(size=(6, 1))
        ) + 3.0 * self.noise * draw(size=(6, 3)) * (planned > 0.0)
        measurement.angle[:] = controller._out.angle_ref + 0.1 * self.noise * draw(size=(6, 3))
        turn = np.array([1.0, *(0.1 * self.noise * draw(size=3))])
        measurement.quaternion[:] = turn / np.linalg.norm(turn)


def differences(
    core: ct.CDLL,
    setup: ControllerSetup,
    *,
    sense: Sense,
    steps: int = STEPS,
    told: Callable[[float], BodyCommand] = program,
    changes: dict[int, Gait] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the largest differences of angle, speed, torque and acceleration over a walk, in rad
    and relative to the servo, and the fallback (steps, 6). The walk ends where they are too large.

    changes: gaits that the walk changes to, by steps.

    Asserts that the diagnostics are the same at every step.
    """
    reference, native = setup.build(), NativeController(core, setup)
    measurement, worst, fallback = Measurement(angle=setup.robot.stance.copy()), np.zeros(4), []
    speed_max, torque_max = setup.robot.servo.speed_max, setup.robot.servo.torque_max
    shown, scale = (
        reference.diagnostics,
        np.array([1.0, speed_max, torque_max, 2.0 * speed_max / setup.period]),
    )
    for k in range(steps):
        t = k * setup.period
        if changes and k in changes:
            reference.change_gait(changes[k])
            native.change_gait(changes[k])
        expected = reference.step(t, told(t), measurement)
        out = native.step(t, told(t), measurement)
        gap = np.abs(commands(out) - [getattr(expected, name) for name in COMMANDS])
        worst = np.maximum(worst, gap.max(axis=(1, 2)) / scale)
        if not (worst <= LIMITS).all():
            break
        for flag in ("swinging", "unreachable", "fallback"):
            assert [bool(value) for value in getattr(out, flag)] == getattr(shown, flag).tolist(), (
                f"{flag} at step {k}"
            )
        got = [np.ctypeslib.as_array(field).ravel() for field in (out.shift, out.lift, out.planned)]
        wanted = np.concatenate([shown.shift.view(float), shown.lift, np.ravel(shown.planned)])
        gap = np.abs(np.concatenate(got) - wanted)  # assert_allclose takes a sixth of a walk's time
        assert (gap <= 1e-12 + 1e-7 * np.abs(wanted)).all(), f"diagnostics at step {k}: {gap}"
        fallback.append(shown.fallback.copy())
        sense(reference, k, measurement)
    return worst, np.array(fallback)


WALKS = [
    *((name, gait, True) for name in ROBOTS for gait in ("tripod", "ripple", "wave")),
    ("athena", "amble", True),
    ("athena", "tripod", False),
    ("phantomx_mk4", "wave", False),
]


def close(worst: np.ndarray) -> bool:
    print(
        "largest differences of angle [rad], speed, torque and acceleration [servo's limit]:",
        worst,
    )
    return bool((worst <= LIMITS).all())


@pytest.mark.parametrize(("name", "gait", "compliant"), WALKS)
def test_a_walk_is_the_same(
    controller_core: ct.CDLL, name: str, gait: str, compliant: bool
) -> None:
    worst, fallback = differences(
        controller_core, setup_of(name, gait, compliant=compliant), sense=Ground()
    )
    assert close(worst)
    assert not fallback.any()


@pytest.mark.parametrize("compliant", [True, False])
def test_a_walk_that_changes_its_gait_is_the_same(
    controller_core: ct.CDLL, compliant: bool
) -> None:
    """The second change is asked for again before it is made, the last one at the end of a stop."""
    robot = load_robot("athena")
    names = {200: "wave", 300: "ripple", 700: "wave", 740: "amble", 1620: "tripod"}
    worst, fallback = differences(
        controller_core,
        setup_of(compliant=compliant),
        sense=Ground(),
        changes={step: make_gait(robot, name) for step, name in names.items()},
    )
    assert close(worst)
    assert not fallback.any()


def test_a_native_change_of_gait_is_saved_restored_and_refused(controller_core: ct.CDLL) -> None:
    robot, measurement = load_robot("athena"), Measurement(angle=load_robot("athena").stance.copy())
    native = NativeController(controller_core, setup_of(compliant=False))

    def go(first: int, last: int) -> np.ndarray:
        return np.array(
            [
                commands(native.step(k * PERIOD, program(0.0), measurement))
                for k in range(first, last)
            ]
        )

    go(0, 420)
    native.change_gait(make_gait(robot, "amble"))
    go(420, 450)
    state = native.save()
    expected = go(450, 700)
    native.restore(state)
    np.testing.assert_array_equal(go(450, 700), expected)
    state = native.save()
    # stance and swing of a wave of 20 ms are shorter than the period; setting it up is refused too
    native.definition["gait.period"] = 0.006
    gait = ct.addressof(native.definition.bytes) + native.definition.ranges["gait.pattern"].offset
    with pytest.raises(NativeError, match="gait's shorter phase"):
        native._checked(controller_core.hx_controller_change_gait(native._handle, gait))
    assert native.save() == state


@pytest.mark.parametrize("name", ROBOTS)
def test_a_walk_under_the_papers_control_is_the_same(controller_core: ct.CDLL, name: str) -> None:
    """The forces are drawn at random, up to both limits of the corrections."""
    generator = np.random.default_rng(5)

    def sense(_: Controller, step: int, measurement: Measurement) -> None:
        size = 1.0 + 9.0 * (step % 400 > 350)
        measurement.foot_force[:] = size * (
            generator.normal(size=(6, 3)) * 5.0 + [8.0 * (step % 900 > 700), 0.0, 10.0]
        )
        turn = np.array([1.0, *(0.02 * generator.normal(size=3))])
        measurement.quaternion[:] = turn / np.linalg.norm(turn)

    setup = replace(setup_of(name), law="paper")
    worst, fallback = differences(controller_core, setup, sense=sense)
    assert close(worst)
    assert not fallback.any()


def dead_and_stuck(force: np.ndarray, step: int) -> None:
    force[1] *= not 400 <= step < 900  # the sensor reads nothing
    if 700 <= step < 1100:
        force[3] = [1.0, -2.0, 15.0]  # another sensor reads the same all the time
    if 1300 <= step < 1500:
        force[[0, 2, 4]] = 0.0


def dragged(force: np.ndarray, step: int) -> None:
    if 500 <= step < 560 or 900 <= step < 1000:
        force[:, 0] += 0.8 * force[:, 2]  # the whole robot slides
    if 1400 <= step < 1500:
        force[:, 0] += 0.8 * force[:, 2]
        force *= 0.4  # and has hardly met the ground


def barely_met(force: np.ndarray, step: int) -> None:
    """Lets the whole robot slide on feet that carry 0.4, then 0.6 of its weight."""
    for begin, share in ((500, 0.4), (900, 0.6)):
        if begin <= step < begin + 40:
            force *= share
            force[:, 0] += 0.8 * force[:, 2]


def uneven(force: np.ndarray, step: int) -> None:
    if step % 200 < 30:
        force[:, 2] += 5.0  # a short contact in mid-swing
    if step % 170 < 12:
        force[2] = 0.0  # a short loss of contact of a standing leg
    if 1000 <= step < 1180:
        force *= 2.0
        force[4] = 0.0  # a long loss of contact, while the other legs carry the load
    if 600 <= step < 800:
        force[:, 1] += [9.0, -9.0, 9.0, -9.0, 9.0, -9.0]  # squeezed beyond all limits


def heavy(force: np.ndarray, step: int) -> None:
    if step >= 300:
        force *= (
            2.1 if step < 900 else 4.2 if step < 1300 else 1.0
        )  # more than the servos carry, then far more, then the planned load


@pytest.mark.parametrize("spoil", [dead_and_stuck, dragged, barely_met, uneven, heavy])
@pytest.mark.parametrize("name", ROBOTS)
def test_sensors_that_lie_ground_that_is_missing_and_slides_are_answered_at_the_same_step(
    controller_core: ct.CDLL, name: str, spoil: Callable[[np.ndarray, int], None]
) -> None:
    ground = Ground()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        spoil(measurement.foot_force, step)

    # with a planned squeeze even four times the weight does not ask too much of the second robot
    setup = setup_of(name, parts=Parts(squeeze=0.0))
    worst, fallback = differences(controller_core, setup, sense=sense)
    assert close(worst)
    assert fallback.any() or spoil is uneven


@pytest.mark.parametrize(
    ("gait", "bump", "parts"),
    [("tripod", 0.02, ALL_PARTS), ("wave", 0.02, ALL_PARTS), ("tripod", 0.039, NO_FALLBACK)],
)
def test_ground_that_is_met_early_is_answered_at_the_same_step(
    controller_core: ct.CDLL, gait: str, bump: float, parts: Parts
) -> None:
    """The ground is met by all feet at 12 mm, by one foot higher, then by none: soft ground with a
    bump, and a torso that has risen again.

    Without fallback the bump is as high as the largest offset of a foot.
    """
    ground = Ground()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        compliant, met = (
            controller.compliant,
            np.where(np.arange(6) == 2, bump, 0.012 if parts is ALL_PARTS else 0.0),
        )
        assert compliant is not None
        height = compliant.stance.plan.height
        if step < 1400:
            measurement.foot_force[(height > 0.0) & (height < met), 2] = 4.0

    worst, _ = differences(controller_core, setup_of(gait=gait, parts=parts), sense=sense)
    assert close(worst)


class LowGround:
    """A sense() for which foot 2 finds the ground 12 mm lower than planned, foot 3 in some steps
    nowhere.

    Attributes:
        held: whether the gait clock waited, for each period.
    """

    def __init__(self) -> None:
        self.ground = Ground()
        self.held: list[bool] = []

    def __call__(self, controller: Controller, step: int, measurement: Measurement) -> None:
        self.ground(controller, step, measurement)
        compliant = controller.compliant
        assert compliant is not None
        lowered, awaited = compliant.laws.touchdown.offset, controller.paths.awaited
        measurement.foot_force[:, 2] += 12.0 * (awaited & (lowered < -0.012))
        measurement.foot_force[2] *= not (controller.paths.swinging[2] and lowered[2] > -0.012)
        measurement.foot_force[3] *= step % 700 < 500
        self.held.append(controller.paths.held)


@pytest.mark.parametrize("gait", ["tripod", "ripple", "amble"])
def test_feet_that_find_no_ground_are_awaited_at_the_same_step(
    controller_core: ct.CDLL, gait: str
) -> None:
    sense = LowGround()
    worst, _ = differences(controller_core, setup_of(gait=gait), sense=sense)
    assert close(worst)
    assert 0.02 < np.mean(sense.held) < 0.8


def test_stops_while_feet_are_awaited_are_the_same(controller_core: ct.CDLL) -> None:
    """Every second command is to stand, given before the last one is reached."""
    sense, stop = LowGround(), BodyCommand()

    def told(t: float) -> BodyCommand:
        return BodyCommand(0.04, 0.01, 0.05) if t % 1.7 < 1.2 else stop

    worst, _ = differences(controller_core, setup_of(), sense=sense, steps=1400, told=told)
    assert close(worst)
    stands = [k for k, held in enumerate(sense.held) if held and told(0.005 * k) is stop]
    assert len(stands) > 20


@pytest.mark.parametrize(("speed_max", "least", "most"), [(3.0, 0.09, 0.11), (2.6, 0.0, 0.02)])
def test_feet_of_joints_that_are_too_slow_are_hardly_awaited(
    controller_core: ct.CDLL, speed_max: float, least: float, most: float
) -> None:
    """At 2.6 rad/s the plan needs more speed for more than a fifth of the time, at 3 rad/s for
    less. The first waits are earlier than the share of the time is known.
    """
    sense, setup = LowGround(), setup_of()
    slow = replace(setup.robot, servo=replace(setup.robot.servo, speed_max=speed_max))
    robot = replace(setup, robot=slow, gains=make_gains(slow))
    worst, _ = differences(controller_core, robot, sense=sense)
    assert close(worst)
    assert least <= np.mean(sense.held) < most


def test_joints_that_are_outrun_fall_back_at_the_same_step(controller_core: ct.CDLL) -> None:
    setup = setup_of()
    slow = replace(setup.robot, servo=replace(setup.robot.servo, speed_max=1.2))
    worst, fallback = differences(
        controller_core,
        replace(setup, robot=slow, gains=make_gains(slow)),
        sense=Ground(),
        steps=2600,
    )
    assert close(worst)
    assert fallback.all(axis=1).any()
    assert not fallback[-1].any()


@pytest.mark.parametrize("part", SWITCHES)
def test_each_part_can_be_switched_off(controller_core: ct.CDLL, part: str) -> None:
    ground = Ground()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        uneven(measurement.foot_force, step)

    assert close(
        differences(
            controller_core,
            setup_of(parts=replace(EVERY_PART, **{part: False})),
            sense=sense,
            steps=900,
        )[0]
    )


@pytest.mark.parametrize("minmax", [False, True])
@pytest.mark.parametrize("gait", ["tripod", "amble"])
@pytest.mark.parametrize("weight", [0.0, 0.1, 0.5, 0.99])
def test_walks_with_a_planned_squeeze_are_the_same(
    controller_core: ct.CDLL, weight: float, gait: str, minmax: bool
) -> None:
    setup = setup_of(gait=gait, parts=Parts(squeeze=weight, minmax_torque=minmax))
    worst, _ = differences(controller_core, setup, sense=Ground(), steps=1000)
    assert close(worst)


@pytest.mark.parametrize(("narrow", "part", "steps"), [(0.03, 1.0, STEPS), (0.0, 0.0, 500)])
def test_steps_of_a_robot_that_is_heavier_than_told_are_the_same(
    controller_core: ct.CDLL, narrow: float, part: float, steps: int
) -> None:
    """Without a narrow stance neither the steps nor the squeeze change."""
    gait = replace(make_gait(load_robot("athena"), "amble"), narrowing=narrow)
    ground, narrowing = Ground(), [0.0]

    def heavy(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        measurement.foot_force[:] *= 1.4
        narrowing.append(controller.paths.narrowing)

    setup = setup_of(gait=gait)
    assert close(differences(controller_core, setup, sense=heavy, steps=steps)[0])
    assert max(narrowing) == part


def test_another_period_gait_and_touch_down_speed_are_the_same_too(
    controller_core: ct.CDLL,
) -> None:
    robot = load_robot("athena")
    gait = Gait(
        name="ripple",
        period=1.3,
        duty=0.62,
        offsets=make_gait(robot, "ripple").offsets,
        step_height=0.03,
        touchdown_speed=0.05,
    )
    setup = ControllerSetup(
        robot=robot, gait=gait, period=0.008, gains=make_gains(robot, period=0.008)
    )
    worst, _ = differences(controller_core, setup, sense=Ground(), steps=1100)
    assert close(worst)


def test_legs_may_differ(controller_core: ct.CDLL) -> None:
    robot = load_robot("athena")
    legs = []
    for k, leg in enumerate(robot.legs):
        links = [
            replace(
                link,
                length=link.length * (1.0 + 0.01 * k),
                offset_y=0.002 * k,
                offset_z=-0.003 * k,
                com=(link.com[0], 0.001 * k, 0.002 * k),
            )
            for link in leg.links
        ]
        legs.append(
            replace(leg, hip_yaw=leg.hip_yaw + 0.05 * k, links=(links[0], links[1], links[2]))
        )
    crooked = replace(robot, legs=tuple(legs), torso=replace(robot.torso, com=(0.01, -0.02, 0.015)))
    setup = ControllerSetup(
        robot=crooked, gait=make_gait(crooked), period=PERIOD, gains=make_gains(crooked)
    )
    assert close(differences(controller_core, setup, sense=Ground(), steps=1400)[0])


# ------------------------------------------------------------------------------------------------
# instances


def stepped(native: NativeController, first: int, count: int) -> np.ndarray:
    """Returns the commands (count, 3, 6, 3) of a walk with pressed and squeezed feet, from step
    `first` on.
    """
    robot, found = load_robot("athena"), []
    generator = np.random.default_rng(8)
    draws = generator.normal(size=(first + count, 6, 3))
    for k in range(first, first + count):
        measurement = Measurement(
            angle=robot.stance + 0.01 * draws[k], foot_force=draws[k] + [0.0, 0.0, 8.0]
        )
        found.append(commands(native.step(k * PERIOD, program(k * PERIOD + 2.5), measurement)))
    return np.array(found)


@pytest.mark.parametrize("compliant", [False, True])
def test_a_restored_state_goes_on_bit_for_bit_and_reset_is_fresh(
    controller_core: ct.CDLL, compliant: bool
) -> None:
    setup = setup_of(compliant=compliant)
    native, other = (
        NativeController(controller_core, setup),
        NativeController(controller_core, setup),
    )
    fresh = native.save()
    start = stepped(native, 0, 137)
    saved = native.save()
    rest = stepped(native, 137, 300)
    other.restore(saved)
    assert other.save() == saved
    np.testing.assert_array_equal(stepped(other, 137, 300), rest)
    assert other.save() == native.save()
    native.reset()
    assert native.save() == fresh
    np.testing.assert_array_equal(stepped(native, 0, 137), start)


def test_inputs_that_change_at_a_rate_are_taken_as_they_are_at_each_tick(
    controller_core: ct.CDLL,
) -> None:
    stepped_input, ramped = (NativeController(controller_core, setup_of()) for _ in range(2))
    rate = HxControllerInput()
    rate.foot_force[1][0], rate.command[0] = 3.0, 0.2
    for k in range(4):
        stepped_input.input.foot_force[1][0], stepped_input.input.command[0] = (
            3.0 * (k * PERIOD),
            0.2 * (k * PERIOD),
        )
        stepped_input.go((k + 1) * PERIOD)
    ramped.go(4 * PERIOD, rate=rate)
    assert ramped.save() == stepped_input.save()


def test_reading_outputs_changes_nothing(controller_core: ct.CDLL) -> None:
    native = NativeController(controller_core, setup_of())
    stepped(native, 0, 50)
    saved = native.save()
    first = commands(native.output())
    native.input.command[0] = 0.3
    native.input.foot_force[0][2] = 50.0
    second = commands(native.output())
    assert (first != second).any()  # outputs depend on inputs directly
    assert native.save() == saved


@pytest.mark.parametrize("between", ["nothing", "another input", "a restored state", "a reset"])
def test_reading_outputs_does_not_change_the_next_step(
    controller_core: ct.CDLL, between: str
) -> None:
    """output() stores its tick for the step that follows, to be used only with the same state and
    the same input.
    """
    native, plain = (NativeController(controller_core, setup_of()) for _ in range(2))
    stepped(native, 0, 50)
    earlier = native.save()
    stepped(native, 50, 7)
    native.input.foot_force[0][2] = 50.0
    native.output()
    if between == "another input":
        native.input.foot_force[0][2] = 40.0
    if between == "a restored state":
        native.restore(earlier)
    if between == "a reset":
        native.reset()
    plain.restore(native.save())
    ct.memmove(ct.byref(plain.input), ct.byref(native.input), ct.sizeof(native.input))
    for one in (native, plain):
        one.go(one.time + 3 * PERIOD)
    assert native.save() == plain.save()


def test_ticks_come_at_their_times_whatever_the_steps_are(controller_core: ct.CDLL) -> None:
    """Steps of two periods execute both ticks under the same input; half a step keeps the commands
    of the last tick.
    """
    setup, force = setup_of(), np.tile([0.2, 0.0, 9.0], (6, 1))
    fine, coarse, half = (NativeController(controller_core, setup, start=7.0) for _ in range(3))
    measurement, command = (
        Measurement(angle=setup.robot.stance.copy(), foot_force=force),
        BodyCommand(vx=0.05),
    )
    for native in (fine, coarse, half):
        native.sense(command, measurement)
    for k in range(300):
        fine.go(7.0 + (2 * k + 1) * PERIOD)
        fine.go(7.0 + (2 * k + 2) * PERIOD)
        coarse.go(7.0 + (2 * k + 2) * PERIOD)
        ticked = commands(half.output())
        half.go(7.0 + (2 * k + 0.5) * PERIOD)
        half.input.command[1] = 0.05  # the input changes between two ticks and changes back
        np.testing.assert_array_equal(commands(half.output()), ticked)
        half.input.command[1] = 0.0
        half.go(7.0 + (2 * k + 2) * PERIOD)
    np.testing.assert_array_equal(commands(fine.output()), commands(coarse.output()))
    np.testing.assert_array_equal(commands(fine.output()), commands(half.output()))
    assert fine.save() == coarse.save() == half.save()


@pytest.mark.parametrize("slip", [-3e-6, 3e-6])
def test_a_clock_that_is_off_by_round_off_ticks_all_the_same(
    controller_core: ct.CDLL, slip: float
) -> None:
    exact, late = (NativeController(controller_core, setup_of(compliant=False)) for _ in range(2))
    for native in (exact, late):
        native.input.command[0] = 0.05
    for k in range(1, 200):
        exact.go(k * PERIOD)
        late.go(k * PERIOD + slip)
    np.testing.assert_array_equal(commands(exact.output()), commands(late.output()))


# ------------------------------------------------------------------------------------------------
# refusals


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("torso.mass", 0.0, "torso.mass: got 0, expected 1e-09 to 1e+09 kg"),
        ("gait.duty", 1.0, "gait.duty: got 1"),
        ("period", 0.6, "period: got 0.6, expected less than 0.5 s, the gait's shorter phase"),
        ("servo.kp", 0.0, "servo.kp: got 0"),
        ("LM.femur.stance", 3.0, "LM.femur.stance: got 3, expected an angle between"),
        ("gains.slip.kp", np.nan, "gains.slip.kp: got"),
        ("control", 4, "control: got 4, expected 1 to 3"),
        ("gait.pattern", 0, "gait.pattern: got 0, expected 1 to 5"),
    ],
)
def test_an_impossible_definition_is_refused_and_changes_nothing(
    controller_core: ct.CDLL, name: str, value: float, expected: str
) -> None:
    native = NativeController(controller_core, setup_of())
    stepped(native, 0, 5)
    saved = native.save()
    native.definition[name] = value
    with pytest.raises(NativeError, match=expected.replace("+", "[+]")):
        native.reset()
    assert native.save() == saved


def test_steps_back_and_inputs_that_are_no_numbers_are_refused(controller_core: ct.CDLL) -> None:
    native = NativeController(controller_core, setup_of())
    stepped(native, 0, 5)
    saved = native.save()
    for t in (0.0, np.nan, np.inf):
        with pytest.raises(NativeError, match="end of step: got"):
            native.go(t)
    native.input.foot_force[2][1] = np.nan
    with pytest.raises(
        NativeError, match=r"LR.foot.force\[2\]: got -?nan, expected -1e[+]09 to 1e[+]09 N"
    ):
        native.go(1.0)
    assert native.save() == saved


def test_a_saved_state_that_is_damaged_is_refused(controller_core: ct.CDLL) -> None:
    native = NativeController(controller_core, setup_of())
    saved = native.save()
    damaged = bytearray(saved)
    damaged[len(saved) // 2] ^= 1
    for bad, reason in (
        (bytes(damaged), "damaged"),
        (saved[:-8], "bytes, expected"),
        (b"x" * len(saved), "version"),
    ):
        with pytest.raises(NativeError, match=reason):
            native.restore(bad)
    assert native.save() == saved


def test_absurd_commands_end_in_finite_joint_commands(controller_core: ct.CDLL) -> None:
    native = NativeController(controller_core, setup_of())
    native.input.command[:] = [10.0, -10.0, 10.0, 10.0, 1.5, -1.5]
    native.input.foot_force[0][2] = 1e9
    for k in range(1, 400):
        native.go(k * PERIOD)
        assert np.isfinite(commands(native.output())).all()
    assert any(native.out.unreachable)


# ------------------------------------------------------------------------------------------------
# functions


def scattered(generator: np.random.Generator, reach: float) -> np.ndarray:
    """Returns feet (6, 2) whose root mean square distance from their centre is this [m]."""
    feet = generator.normal(size=(6, 2))
    return np.asarray(feet * reach / np.sqrt(((feet - feet.mean(axis=0)) ** 2).sum() / 6.0))


def pointers(*arrays: np.ndarray) -> list[ct.c_void_p]:
    return [array.ctypes.data_as(ct.c_void_p) for array in arrays]


@pytest.mark.parametrize("load", [1.0, 0.3e-6, 0.12e-6, 0.0])
@pytest.mark.parametrize("reach", [0.2, 0.0101, 0.0099])
def test_the_squeeze_is_the_same_down_to_feet_without_load_or_that_stand_together(
    controller_core: ct.CDLL, load: float, reach: float
) -> None:
    generator = np.random.default_rng(6)
    for _ in range(10):
        found, feet, normal = (
            generator.normal(size=(6, 2)),
            scattered(generator, reach),
            np.full(6, load),
        )
        expected = squeeze(
            np.asarray(found @ [1.0, 1.0j], dtype=np.complex128), normal, feet @ [1.0, 1.0j]
        )
        controller_core.hx_probe_squeeze(*pointers(normal, feet, found))
        np.testing.assert_allclose(found @ [1.0, 1.0j], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("load", "reach"),
    [(50.0, 0.2), (50.0, 0.0125), (50.0, 0.0101), (50.0, 0.0099), (1.5e-6, 0.2), (0.6e-6, 0.2)],
)
def test_shares_are_the_same_down_to_no_load_or_feet_that_stand_together(
    controller_core: ct.CDLL, load: float, reach: float
) -> None:
    robot, generator = load_robot("athena"), np.random.default_rng(7)
    rest = InverseDynamics(robot, LegSolver(robot), period=PERIOD).rest()
    support, none = (
        Support(robot, make_gait(robot), make_gains(robot).support, rest=rest),
        np.zeros((6, 3)),
    )
    for active in (np.ones(6), generator.uniform(0.0, 1.0, 6), np.full(6, 1e-6)):
        feet, asked, found = (
            scattered(generator, reach),
            np.array([0.3, -0.2, load, 0.0, 0.0, 0.4]),
            np.empty((6, 3)),
        )
        controller_core.hx_probe_shares(*pointers(feet, active, asked, found))
        demand = Demand(
            none, np.zeros((6, 3, 3)), push=0.3 - 0.2j, weight=load, moment=0j, twist=0.4,
        )  # fmt: skip
        expected = support.shares(feet @ [1.0, 1.0j], active, demand).forces()
        scale = np.abs(expected).max(axis=0)  # scales of the pushes and of the loads
        np.testing.assert_allclose(
            found / scale, expected / scale, atol=1e-9
        )  # the system's condition number is at most 1e6


@pytest.mark.parametrize("ratio", [0.05, 0.999999, 1.0, 1.000001, 3.0, 1e4])
def test_the_suspension_is_the_matrix_exponential_whatever_its_damping(
    controller_core: ct.CDLL, ratio: float
) -> None:
    mass, stiffness, period = 1.7, 4100.0, 0.005
    damping, system = 2.0 * ratio * np.sqrt(stiffness * mass), np.zeros((3, 3))
    system[0, 1], system[1] = 1.0, np.array([-stiffness, -damping, 1.0]) / mass
    found = (ct.c_double * 6)()
    controller_core.hx_probe_suspension(
        *(ct.c_double(value) for value in (mass, damping, stiffness, period)), found
    )
    expected = expm(system * period)
    scale = np.array([[1.0, period], [1.0 / period, 1.0]])
    np.testing.assert_allclose(
        np.array(found[:4]).reshape(2, 2) / scale, expected[:2, :2] / scale, atol=1e-12
    )
    np.testing.assert_allclose(found[4:], expected[:2, 2], rtol=1e-9, atol=1e-12 / stiffness)
