"""Makes the set-up of a controller: robot, gait, period and gains."""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.controller import Gains, GainsError, Gait, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.run.preparation import designed_gains
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models import Robot, unknown_name


def make_setup(
    robot: Robot,
    *,
    control: str,
    period: float,
    gait: str | Gait | None = None,
    gains: Gains | None = None,
) -> ControllerSetup:
    """Returns the controller's set-up as `simulate` would make it.

    Args:
        control: "kinematic", "paper" or "compliant".
        period: controller period [s].
        gait: a gait or its name; by default the gait of the robot file.
        gains: gains of paper or compliant control; by default they are designed for the robot.

    Raises:
        HexapodError: the control or the gait is unknown.
        GainsError: gains are given for kinematic control, or none can be designed.
    """
    if control not in CONTROLS:
        raise unknown_name("control", control, CONTROLS)
    walked = gait if isinstance(gait, Gait) else make_gait(robot, gait)
    setup = ControllerSetup(robot=robot, gait=walked, period=period)
    setup.build()  # refuses an impossible set-up before gains are designed
    if control == "kinematic":
        if gains is not None:
            raise GainsError(
                "gains for kinematic control, which has none",
                got=control,
                expected="paper or compliant",
                fix="leave out the gains",
            )
        return setup
    chosen = designed_gains(robot, period) if gains is None else gains
    return replace(setup, gains=chosen, law=control)
