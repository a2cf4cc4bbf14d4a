"""Provides the control laws of a robot that stands in its stance on all legs or some."""

from __future__ import annotations

from functools import cache

import numpy as np
from gains import PERIOD, make_gains, weight

from hexapod_cosim.controller import Gains, LegSolver, Parts, make_gait
from hexapod_cosim.controller.comply.force_laws import ForceLaws
from hexapod_cosim.controller.comply.load_plan import LoadPlan, plan_load
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.walk.gait_clock import GaitClock
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.models import Robot, load_robot

ROBOT = load_robot("athena")
WEIGHT = weight(ROBOT)  # N
GAINS = make_gains(ROBOT)
HOME = LegSolver(ROBOT).forward(ROBOT.stance)[:, :2] @ np.array([1.0, 1.0j])
ALL = "111111"
DEPTH = 0.135  # m; of the ground below the torso's origin
RAISED = 0.03  # m; height of a foot in mid-swing


@cache
def rest(robot: Robot) -> Demand:
    return InverseDynamics(robot, LegSolver(robot), period=PERIOD).rest()


class Laws(ForceLaws):
    """The laws, and what the present step requires of them."""

    planned: LoadPlan

    def feel(self, force: np.ndarray) -> None:
        """Advances the laws by one period under forces (6, 3) on the feet."""
        self.step(self.planned, force)


def make_laws(
    robot: Robot = ROBOT, *, gains: Gains | None = None, parts: Parts | None = None
) -> Laws:
    """Returns the laws at rest, without a plan."""
    gait, gains = make_gait(robot), make_gains(robot) if gains is None else gains
    return Laws(
        gains,
        parts or Parts(),
        weight=weight(robot),
        depth=DEPTH,
        cycle=gait.period,
        step_height=gait.step_height,
        period=PERIOD,
    )


def plan(
    laws: Laws,
    *,
    robot: Robot = ROBOT,
    standing: str = ALL,
    height: float = RAISED,
    rise: float = 0.0,
) -> None:
    """Plans a step in which these legs stand and the others are in the air, at a height [m] and a
    vertical speed [m/s].
    """
    still = rest(robot)
    stands = np.array([flag == "1" for flag in standing])
    home = LegSolver(robot).forward(robot.stance)[:, :2] @ np.array([1.0, 1.0j])
    support = Support(robot, make_gait(robot), make_gains(robot).support, rest=still)
    shares, air = support.shares(home, stands.astype(float), still), 1.0 - stands
    clock = GaitClock(make_gait(robot), period=PERIOD)
    clock.swinging = ~stands
    laws.planned = plan_load(
        still,
        shares,
        clock,
        active=laws.parts.support,
        feet=home,
        height=height * air,
        rise=rise * air,
        period=PERIOD,
    )


def shared(laws: Laws) -> np.ndarray:
    """Returns the planned forces, shape (6, 3)."""
    return laws.planned.shares.forces()


def squeezing(size: float = 2.0) -> np.ndarray:
    """Returns forces (6, 3): equal loads on all feet, the middle ones pushed apart."""
    force = np.zeros((6, 3))
    force[:, 2] = WEIGHT / 6.0
    force[1, 1], force[4, 1] = size, -size
    return force


def run(
    laws: Laws,
    force: np.ndarray,
    steps: int,
    *,
    robot: Robot = ROBOT,
    standing: str = ALL,
    height: float = RAISED,
) -> None:
    """Takes a number of steps under the same plan and forces."""
    plan(laws, robot=robot, standing=standing, height=height)
    for _ in range(steps):
        laws.feel(force)
