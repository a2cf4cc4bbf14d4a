"""The control changes while the robot walks, in the Python controller and in the C controller."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from gains import make_gains
from native_controller import NativeController, NativeError, commands

from hexapod_cosim.controller import BodyCommand, Controller, Gains, Measurement, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import HexapodError, load_robot

CONTROLS = ("kinematic", "compliant", "paper")
CYCLE = [("kinematic", "compliant"), ("compliant", "paper"), ("paper", "kinematic")]
STEP = 0.005  # s
WALK = BodyCommand(vx=0.06, yaw_rate=0.05)
ROBOT = load_robot("athena")
GAINS = make_gains(ROBOT)
# rad, rad/s, N m, rad/s2    rounding errors; accelerations are second differences
LIMITS = (2e-12, 2e-10, 2e-10, 2e-8)


def law_of(control: str) -> tuple[Gains | None, str]:
    return (None, "compliant") if control == "kinematic" else (GAINS, control)


def setup_of(control: str, gait: str = "amble") -> ControllerSetup:
    gains, law = law_of(control)
    return ControllerSetup(
        robot=ROBOT, gait=make_gait(ROBOT, gait), period=STEP, gains=gains, law=law
    )


def native_of(core: ct.CDLL, control: str, gait: str = "amble") -> NativeController:
    """Returns the C controller, which has the gains under every control."""
    native = NativeController(core, setup_of("compliant", gait))
    native.definition["control"] = 1 + CONTROLS.index(control)
    native.reset()
    return native


def sense(controller: Controller, generator: np.random.Generator, seen: Measurement) -> None:
    """Measures forces near to even ones on the standing feet, with noise."""
    stands = ~controller.diagnostics.swinging
    seen.foot_force[:] = 0.0
    seen.foot_force[stands, 2] = ROBOT.weight / stands.sum()
    seen.foot_force[stands] += 0.3 * generator.normal(size=(int(stands.sum()), 3))
    seen.angle[:] = controller._out.angle_ref + 0.002 * generator.normal(size=(6, 3))


@pytest.mark.parametrize("pair", list(permutations(CONTROLS, 2)), ids="-".join)
@pytest.mark.parametrize("step", [1, 340])
def test_python_and_c_change_the_control_alike(
    controller_core: ct.CDLL, pair: tuple[str, str], step: int
) -> None:
    first, then = pair
    lead, native = setup_of(first).build(), native_of(controller_core, first)
    seen, generator = Measurement(angle=ROBOT.stance.copy()), np.random.default_rng(3)
    changes = {step: then, step + 30: first, step + 150: then}
    for k in range(step + 400):
        if k in changes:
            lead.change_control(*law_of(changes[k]))
            native.change_control(changes[k])
        if k == step + 200:
            lead.change_gait(make_gait(ROBOT, "tripod"))
            native.change_gait(make_gait(ROBOT, "tripod"))
        if k == step + 210:
            lead.change_control(*law_of(first))
            native.change_control(first)
        ours = lead.step(k * STEP, WALK, seen)
        theirs = commands(native.step(k * STEP, WALK, seen))
        for name, values, limit in zip(
            ("angle_ref", "speed_ref", "torque_ref", "acceleration_ref"),
            theirs,
            LIMITS,
            strict=True,
        ):
            np.testing.assert_allclose(
                values, getattr(ours, name), rtol=0.0, atol=limit, err_msg=f"{name} at {k}"
            )
        assert [bool(flag) for flag in native.out.swinging] == lead.diagnostics.swinging.tolist()
        sense(lead, generator, seen)
    assert lead.gait.name == "tripod"


def test_the_phase_and_the_command_go_on_when_the_control_changes() -> None:
    """Kinematic control and paper control without forces plan the same feet.

    The joints follow their commands: the servos work, so no leg is out of service (C57).
    """
    lead, other = setup_of("kinematic").build(), setup_of("kinematic").build()
    seen = Measurement(angle=ROBOT.stance.copy())
    for k in range(900):
        if k == 333:
            lead.change_control(GAINS, "paper")
        if k == 700:
            lead.change_control(None)
        ours, theirs = lead.step(k * STEP, WALK, seen), other.step(k * STEP, WALK, seen)
        np.testing.assert_allclose(
            lead.diagnostics.planned, other.diagnostics.planned, rtol=0.0, atol=1e-12
        )
        np.testing.assert_array_equal(lead.diagnostics.swinging, other.diagnostics.swinging)
        seen.angle[:] = ours.angle_ref
    # rad    100 steps after the last change nothing of it is left
    np.testing.assert_allclose(ours.angle_ref, theirs.angle_ref, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(ours.torque_ref, 0.0)


def test_angles_and_speeds_begin_with_those_of_the_control_before() -> None:
    """The first command after a change is the last one, continued by a period."""
    seen, generator = Measurement(angle=ROBOT.stance.copy()), np.random.default_rng(5)
    for first, then in CYCLE:
        lead = setup_of(first).build()
        for k in range(371):
            lead.step(k * STEP, WALK, seen)
            sense(lead, generator, seen)
        last = [part.copy() for part in vars(lead._out).values()]
        lead.change_control(*law_of(then))
        out = lead.step(371 * STEP, WALK, seen)
        np.testing.assert_allclose(out.angle_ref, last[0] + STEP * last[1], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(out.speed_ref, last[1], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(out.torque_ref, last[2], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("pair", CYCLE, ids="-".join)
def test_a_state_saved_during_a_change_of_control_continues_with_the_same_bits(
    controller_core: ct.CDLL, pair: tuple[str, str]
) -> None:
    first, then = pair
    lead, native = setup_of(first).build(), native_of(controller_core, first)
    seen = Measurement(angle=ROBOT.stance.copy())

    def go(begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        found = [
            (
                lead.step(k * STEP, WALK, seen).angle_ref.copy(),
                commands(native.step(k * STEP, WALK, seen)),
            )
            for k in range(begin, end)
        ]
        return np.array([one for one, _ in found]), np.array([one for _, one in found])

    go(0, 340)
    before = lead.save(), native.save()
    lead.change_control(*law_of(then))
    native.change_control(then)
    states = [(lead.save(), native.save())]
    expected = [go(340, 370)]
    states.append((lead.save(), native.save()))
    expected.append(go(370, 600))
    for state, (begin, end), (ours, theirs) in zip(
        states, ((340, 370), (370, 600)), expected, strict=True
    ):
        lead.restore(before[0])  # the control of a state is restored with it
        native.restore(before[1])
        lead.restore(state[0])
        native.restore(state[1])
        again = go(begin, end)
        np.testing.assert_array_equal(again[0], ours)
        np.testing.assert_array_equal(again[1], theirs)


def test_an_unknown_control_is_refused_and_the_walk_goes_on(controller_core: ct.CDLL) -> None:
    lead, native = setup_of("compliant").build(), native_of(controller_core, "compliant")
    seen = Measurement(angle=ROBOT.stance.copy())
    for k in range(50):
        lead.step(k * STEP, WALK, seen)
        native.step(k * STEP, WALK, seen)
    state = native.save()
    with pytest.raises(HexapodError, match="unknown law: got 'elastic'"):
        lead.change_control(GAINS, "elastic")
    assert lead.law == "compliant"
    core = controller_core
    with pytest.raises(NativeError, match=r"control: got 4"):
        native._checked(core.hx_controller_change_control(native._handle, 4))
    assert native.save() == state


def test_a_robot_without_stiff_servos_keeps_kinematic_control(controller_core: ct.CDLL) -> None:
    """The other controls shift the targets of position servos."""
    native = NativeController(controller_core, replace(setup_of("kinematic")))
    native.definition["servo.kp"] = 0.0
    native.reset()
    state = native.save()
    with pytest.raises(NativeError, match=r"servo.kp: got 0"):
        native.change_control("compliant")
    assert native.save() == state
