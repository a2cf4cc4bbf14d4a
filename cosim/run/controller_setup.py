"""Makes the set-up of a controller: robot, gait, period and gains."""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.controller import Gains, GainsError, make_gait
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models import Robot, unknown_name


def make_setup(
    robot: Robot,
    *,
    control: str,
    period: float,
    gait: str | None = None,
    gains: Gains | None = None,
) -> ControllerSetup:
    """Returns the set-up that `simulate` uses for a robot, with its own gait or one by name.

    Under compliant control, gains are designed for the robot unless they are given. Raises
    HexapodError for an unknown control or gait; GainsError for gains without compliant control and
    where no gains can be designed.
    """
    if control not in CONTROLS:
        raise unknown_name("control", control, CONTROLS)
    setup = ControllerSetup(robot=robot, gait=make_gait(robot, gait), period=period)
    setup.build()  # raises errors before the design, which takes long
    if control == "kinematic":
        if gains is not None:
            raise GainsError(
                "gains without compliant control",
                got=control,
                expected="compliant",
                fix="leave out the gains",
            )
        return setup
    if gains is None:
        # python-control takes a second to import
        from hexapod_cosim.cosim.design.design import design_for  # noqa: PLC0415

        gains = design_for(robot, period)
    return replace(setup, gains=gains)
