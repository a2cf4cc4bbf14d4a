"""Controls the robot: computes joint commands from a body velocity and from foot forces.

Imports `models`.
"""

from hexapod_cosim.controller.checks import ControllerError
from hexapod_cosim.controller.controller import Controller
from hexapod_cosim.controller.gains import (
    SWITCHES,
    Gains,
    GainsError,
    Margins,
    PaperGains,
    Parts,
    Requirements,
)
from hexapod_cosim.controller.gains_file import load_gains, save_gains
from hexapod_cosim.controller.signals import DEFAULT_PERIOD, Diagnostics, JointCommand, Measurement
from hexapod_cosim.controller.walk.command import BodyCommand, CommandRamp
from hexapod_cosim.controller.walk.foot_paths import FootPaths
from hexapod_cosim.controller.walk.gait import PATTERNS, Gait, Pattern, make_gait
from hexapod_cosim.controller.walk.kinematics import LegSolver

__all__ = [
    "DEFAULT_PERIOD",
    "PATTERNS",
    "SWITCHES",
    "BodyCommand",
    "CommandRamp",
    "Controller",
    "ControllerError",
    "Diagnostics",
    "FootPaths",
    "Gains",
    "GainsError",
    "Gait",
    "JointCommand",
    "LegSolver",
    "Margins",
    "Measurement",
    "PaperGains",
    "Parts",
    "Pattern",
    "Requirements",
    "load_gains",
    "make_gait",
    "save_gains",
]
