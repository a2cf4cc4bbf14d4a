"""Controllers with hand-made gains, and functions that run them."""

from __future__ import annotations

import numpy as np
from gains import PERIOD, make_gains

from hexapod_cosim.controller import BodyCommand, Controller, Gait, Measurement, Parts, make_gait
from hexapod_cosim.models import load_robot


def make(
    name: str = "athena",
    *,
    gait: Gait | None = None,
    compliant: bool = False,
    parts: Parts | None = None,
) -> Controller:
    robot = load_robot(name)
    return Controller(
        robot,
        period=PERIOD,
        gait=make_gait(robot) if gait is None else gait,
        gains=make_gains(robot) if compliant else None,
        parts=parts or Parts(),
    )


def run(
    controller: Controller,
    command: BodyCommand,
    steps: int,
    *,
    first: int = 0,
    measurement: Measurement | None = None,
) -> np.ndarray:
    """Returns angle_ref, speed_ref and torque_ref of consecutive steps, shape (steps, 3, 6, 3)."""
    found = []
    for k in range(first, first + steps):
        out = controller.step(k * PERIOD, command, measurement or Measurement())
        found.append(np.stack([out.angle_ref, out.speed_ref, out.torque_ref]))
    return np.array(found)


def squeezed(generator: np.random.Generator | None = None) -> Measurement:
    """Returns a measurement with all feet on the ground, unequal forces, joints off the stance and
    an inclined torso.
    """
    generator = generator or np.random.default_rng(4)
    measurement = Measurement(contact=np.ones(6, dtype=bool))
    measurement.foot_force[:] = generator.normal(size=(6, 3)) * 2.0 + [0.0, 0.0, 9.0]
    measurement.angle[:] = load_robot("athena").stance + 0.01 * generator.normal(size=(6, 3))
    measurement.quaternion[:] = [np.cos(0.01), 0.6 * np.sin(0.01), -0.8 * np.sin(0.01), 0.0]
    return measurement


def obey(controller: Controller, command: BodyCommand, steps: int) -> np.ndarray:
    """Runs a controller of a robot that follows every plan.

    The feet carry the planned shares and the joints are at their commanded angles.
    """
    measurement, compliant, found = (
        Measurement(angle=controller.stance.copy()),
        controller.compliant,
        [],
    )
    for k in range(steps):
        out = controller.step(k * PERIOD, command, measurement)
        found.append(np.stack([out.angle_ref, out.speed_ref, out.torque_ref]))
        if compliant is not None:
            measurement.foot_force[:] = compliant.present.load.shares.forces()
            measurement.angle[:] = out.angle_ref
    return np.array(found)
