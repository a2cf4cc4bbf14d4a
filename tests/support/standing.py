"""The force laws of a robot that stands in its stance on all legs or some."""

from __future__ import annotations

from functools import cache

import numpy as np
from gains import PERIOD, make_gains, weight

from hexapod_cosim.controller import Gains, LegSolver, Parts, make_gait
from hexapod_cosim.controller.compliance import Compliance
from hexapod_cosim.controller.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.controller.support import Support
from hexapod_cosim.models import Robot, load_robot

ROBOT = load_robot("athena")
WEIGHT = weight(ROBOT)  # N
GAINS = make_gains(ROBOT)
HOME = LegSolver(ROBOT).forward(ROBOT.stance)[:, :2] @ np.array([1.0, 1.0j])
ALL = "111111"
RAISED = 0.03  # m    height of a foot in mid-swing


@cache
def rest(robot: Robot) -> Demand:
    return InverseDynamics(robot, LegSolver(robot), period=PERIOD).rest()


def make_laws(
    robot: Robot = ROBOT, *, gains: Gains | None = None, parts: Parts | None = None
) -> Compliance:
    """Returns the laws at rest, without a plan."""
    gait, gains = make_gait(robot), make_gains(robot) if gains is None else gains
    return Compliance(
        gains,
        Parts() if parts is None else parts,
        weight=weight(robot),
        cycle=gait.period,
        kp=robot.servo.kp,
        step_height=gait.step_height,
        period=PERIOD,
    )


def plan(
    laws: Compliance,
    steps: int,
    *,
    robot: Robot = ROBOT,
    standing: str = ALL,
    height: float = RAISED,
    rise: float = 0.0,
) -> None:
    """Plans steps in which these legs stand and the others are in the air, at a height [m] and a
    vertical speed [m/s].
    """
    still = rest(robot)
    demand = Demand(
        *(
            np.repeat(getattr(still, name), steps, axis=0)
            for name in ("torque", "lever", "push", "weight", "moment", "twist")
        )
    )
    stands = np.array([flag == "1" for flag in standing])
    home = LegSolver(robot).forward(robot.stance)[:, :2] @ np.array([1.0, 1.0j])
    support = Support(robot, make_gait(robot), make_gains(robot).support, rest=still)
    rows = np.tile(stands.astype(float), (steps, 1))
    shares = support.shares(np.tile(home, (steps, 1)), rows, demand)
    air = 1.0 - rows
    laws.plan(
        demand,
        shares,
        feet=np.tile(home, (steps, 1)),
        height=height * air,
        rise=rise * air,
        swinging=~stands,
    )


def shared(laws: Compliance) -> np.ndarray:
    """Returns the planned forces, shape (6, 4)."""
    return np.asarray(laws._plan.shares.forces(0))


def squeezing(size: float = 2.0) -> np.ndarray:
    """Returns forces (6, 4): equal loads on all feet, the middle ones pushed apart."""
    force = np.zeros((6, 4))
    force[:, 2] = WEIGHT / 6.0
    force[1, 1], force[4, 1] = size, -size
    return force


def run(
    laws: Compliance,
    force: np.ndarray,
    steps: int,
    *,
    robot: Robot = ROBOT,
    standing: str = ALL,
    height: float = RAISED,
) -> None:
    """Plans and takes a number of steps under the same forces."""
    plan(laws, steps, robot=robot, standing=standing, height=height)
    for _ in range(steps):
        laws.step(force)
