"""Instances of the C controller: saved states, outputs, ticks and refusals."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from gains import PERIOD
from native_controller import HxControllerInput, NativeController, NativeError, commands
from native_walks import program, setup_of

from hexapod_cosim.controller import BodyCommand, Measurement, make_gait
from hexapod_cosim.models import load_robot


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
    gait = native.definition.bytes.gait
    with pytest.raises(NativeError, match="gait's shorter phase"):
        native._checked(controller_core.hx_controller_change_gait(native._handle, gait))
    assert native.save() == state


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
        found.append(commands(native.step(k * PERIOD, program(k * PERIOD + 1.5), measurement)))
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
    rate.foot_force[1][0], rate.command.vx = 3.0, 0.2
    for k in range(4):
        stepped_input.input.foot_force[1][0], stepped_input.input.command.vx = (
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
    native.input.command.vx = 0.3
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
        half.input.command.vy = 0.05  # the input changes between two ticks and changes back
        np.testing.assert_array_equal(commands(half.output()), ticked)
        half.input.command.vy = 0.0
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
        native.input.command.vx = 0.05
    for k in range(1, 200):
        exact.go(k * PERIOD)
        late.go(k * PERIOD + slip)
    np.testing.assert_array_equal(commands(exact.output()), commands(late.output()))


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("torso.mass", 0.0, "torso.mass: got 0, expected 1e-09 to 1e+09 kg"),
        ("gait.duty", 1.0, "gait.duty: got 1"),
        ("period", 0.6, "period: got 0.6, expected less than 0.5 s, the gait's shorter phase"),
        ("servo.kp", 0.0, "servo.kp: got 0"),
        ("LM.femur.stance", 3.0, "LM.femur.stance: got 3, expected an angle between"),
        ("gains.hold.path_rate", np.nan, "gains.hold.path_rate: got"),
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
    for bad in (bytes(damaged), b"x" * len(saved)):
        with pytest.raises(NativeError, match="damaged"):
            native.restore(bad)
    assert native.save() == saved


def test_absurd_commands_end_in_finite_joint_commands(controller_core: ct.CDLL) -> None:
    native = NativeController(controller_core, setup_of())
    native.input.command = type(native.input.command)(10.0, -10.0, 10.0, 10.0, 1.5, -1.5)
    native.input.foot_force[0][2] = 1e9
    for k in range(1, 400):
        native.go(k * PERIOD)
        assert np.isfinite(commands(native.output())).all()
    assert any(native.out.unreachable)
