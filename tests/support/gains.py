"""Provides hand-made gains, so that tests of the controller do not depend on the design."""

from __future__ import annotations

import math

from hexapod_cosim.controller import Controller, Gains, Margins, PaperGains, Requirements
from hexapod_cosim.controller.gains import HoldGains, LimitGains, SupportGains
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import Robot, load_robot

PERIOD = 0.005  # s
MARGINS = Margins(
    support_torque=0.0,
    binding="none",
    paper_phase_margin=60.0,
    paper_gain_margin=8.0,
    paper_spectral_radius=0.99,
)
PAPER = PaperGains(
    share=0.38,
    height_share=0.5,
    share_limit=0.66,
    yield_share=0.3,
    return_rate=3.0,
    filter_time=0.005,
    damping=10.0,
    return_time=3.0,
    sag_limit=0.002,
    limit=0.03,
)
HOLD = HoldGains(
    attitude_rate=2.0,
    height_rate=2.0,
    ground_time=2.0,
    angle_limit=0.05,
    height_limit=0.01,
    path_rate=0.5,
    speed_limit=0.02,
    turn_limit=0.05,
)


def weight(robot: Robot) -> float:
    """Returns the robot's weight [N]."""
    return robot.total_mass * math.hypot(*robot.gravity)


def make_gains(robot: Robot, *, period: float = PERIOD) -> Gains:
    """Returns plausible gains for a robot and period."""
    return Gains(
        robot=robot.name,
        robot_hash=robot.hash,
        period=period,
        requirements=Requirements(),
        support=SupportGains(handover_time=0.05, weight_time=0.5, load_time=0.03),
        hold=HOLD,
        limits=LimitGains(torque=0.9 * robot.servo.torque_max),
        paper=PAPER,
        margins=MARGINS,
    )


def gains_of(scenario: Scenario) -> Gains | None:
    """Returns plausible gains for a scenario; None under kinematic control."""
    if scenario.control == "kinematic":
        return None
    return make_gains(load_robot(scenario.robot), period=scenario.macro_step)


def unwatched(controller: Controller) -> Controller:
    """Lets a controller ignore its servos' torques (C57), as kinematic control does: measured
    values that a test makes up do not follow the commands, and its legs would count as lost.
    """
    controller.health.most = math.inf
    return controller
