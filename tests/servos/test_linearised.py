"""Design of gains for measured servos: the robot at rest with dry friction, and without any."""

from __future__ import annotations

import numpy as np
from test_measured_servos import with_servo

from hexapod_cosim.cosim.design.gains import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import ANGLES, linearise
from hexapod_cosim.cosim.design.standing import rest
from hexapod_cosim.models import load_robot


def test_gears_that_slip_leave_out_all_dry_friction() -> None:
    """What is left of a joint's speed after 5 ms: next to nothing where friction holds it."""
    robot, left = with_servo(load_robot("athena"), "mx64_m6"), []
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES["six legs"], load=1.0)
        for friction in (robot.servo.coulomb_friction, 0.0):
            plant = linearise(fmu, robot, motion, inputs, period=0.005, coulomb_friction=friction)
            left.append(np.abs(np.diag(plant.system.A)[-ANGLES:]))
    assert np.all(left[0] < 0.02)
    assert np.all(left[1] > 0.05)
