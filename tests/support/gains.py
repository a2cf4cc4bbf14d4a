"""Provides hand-made gains, so that tests of the controller do not depend on the design."""

from __future__ import annotations

import math

from hexapod_cosim.controller import Gains, Margins, Requirements, SuspensionGains
from hexapod_cosim.controller.gains import (
    TRIPOD_LEGS,
    HoldGains,
    LimitGains,
    PaperSlipGains,
    SupportGains,
)
from hexapod_cosim.models import Robot

PERIOD = 0.005  # s
MARGINS = Margins(
    support_torque=0.0,
    binding="none",
    paper_phase_margin=60.0,
    paper_gain_margin=8.0,
    paper_spectral_radius=0.99,
)
PAPER_SLIP = PaperSlipGains(
    kp=1e-4,
    ki=2e-3,
    kd=1e-6,
    derivative_time=0.01,
    filter_time=0.01,
    load_time=0.03,
    tracking_time=0.02,
    limit=0.015,
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


def suspension(
    robot: Robot, *, deflection: float = 0.003, frequency: float = 5.0
) -> SuspensionGains:
    """Returns a critically damped suspension with this deflection under a third of the weight [m]
    and this natural frequency [Hz].
    """
    stiffness, omega = weight(robot) / TRIPOD_LEGS / deflection, 2.0 * math.pi * frequency
    return SuspensionGains(
        mass=stiffness / omega**2, damping=2.0 * stiffness / omega, stiffness=stiffness, limit=0.015
    )


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
        paper_slip=PAPER_SLIP,
        paper_suspension=suspension(robot),
        margins=MARGINS,
    )
