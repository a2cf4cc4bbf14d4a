"""Walks of the C controller beside the Python controller, under measurements that are made up."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable

import numpy as np
from gains import PERIOD, make_gains
from native_controller import COMMANDS, NativeController, commands

from hexapod_cosim.controller import BodyCommand, Controller, Gait, Measurement, Parts, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

ALL_PARTS = Parts()
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
STEPS = 1000  # a walk of 5 s
PROGRAM = 7.5  # s    of the program below
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
    if t < 2.0:
        return BodyCommand(vx=0.04)
    if t < 2.3:
        return BodyCommand(0.02, -0.01, 0.05)
    if t < 4.2:
        return BodyCommand(0.02, 0.015, 0.08, 0.008, 0.04, -0.03)
    return BodyCommand(yaw_rate=0.1) if t < 5.6 else BodyCommand()


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
        planned = compliant.present.load.shares.forces()
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
    command_at: Callable[[float], BodyCommand] | None = None,
    changes: dict[int, Gait] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the largest differences of angle, speed, torque and acceleration over a walk, in rad
    and relative to the servo, and the fallback (steps, 6). The walk ends where they are too large.

    command_at: the command at a time [s]; by default the program, which takes the whole walk.
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
        command = program(PROGRAM * k / steps) if command_at is None else command_at(t)
        if changes and k in changes:
            reference.change_gait(changes[k])
            native.change_gait(changes[k])
        expected = reference.step(t, command, measurement)
        out = native.step(t, command, measurement)
        gap = np.abs(commands(out) - [getattr(expected, name) for name in COMMANDS])
        worst = np.maximum(worst, gap.max(axis=(1, 2)) / scale)
        if not (worst <= LIMITS).all():
            break
        for flag in ("swinging", "unreachable", "fallback", "absent", "outrun", "doubted"):
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


def close(worst: np.ndarray) -> bool:
    print(
        "largest differences of angle [rad], speed, torque and acceleration [servo's limit]:", worst
    )
    return bool((worst <= LIMITS).all())


def follow_forces(controller: Controller, measurement: Measurement) -> None:
    """Deflects the joints as working servos under these forces, so that C57 finds no fault."""
    health, force = controller.health, measurement.foot_force
    load = health.legs.load_torques(measurement.angle, force)
    measurement.angle[:] += (controller._out.torque_ref - load) / health.stiffness


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
