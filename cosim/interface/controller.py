"""The variables of the controller's FMU, from controller/fmu/interface.toml and one setup of the
controller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

from hexapod_cosim.controller import Controller, Gains, Gait, Parts
from hexapod_cosim.controller.size import requirements_for, sections_for
from hexapod_cosim.cosim.common.components import CONTROLLER
from hexapod_cosim.cosim.interface.plant import expand_interface, parameter_values
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.models import Robot

ALL_PARTS = Parts()
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class ControllerSetup:
    """The arguments of `Controller`. Without gains the control is kinematic, otherwise `law`."""

    robot: Robot
    gait: Gait
    period: float  # s
    gains: Gains | None = None
    parts: Parts = ALL_PARTS
    law: str = "compliant"

    @property
    def control(self) -> str:
        """Name of the control: kinematic without gains, otherwise that of the law."""
        return "kinematic" if self.gains is None else self.law

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about gains of another robot or period, as of the Python controller."""
        return self.gains.warnings(self.robot, period=self.period) if self.gains else ()

    def build(self) -> Controller:
        """Builds the Python controller. Raises RobotError or ControllerError for invalid values."""
        return Controller(
            self.robot,
            period=self.period,
            gait=self.gait,
            gains=self.gains,
            parts=self.parts,
            law=self.law,
        )


@lru_cache(maxsize=16)
def load_controller_interface(setup: ControllerSetup) -> Interface:
    """Returns the interface of a controller's FMU.

    Raises the errors of `Controller`, and HexapodError when a value is out of its variable's range.
    """
    setup.build()  # checks joint axes and gait, which the C code does not
    return expand_interface(CONTROLLER, setup.robot, controller_roots(setup))


def controller_roots(setup: ControllerSetup) -> SimpleNamespace:
    """Returns the objects that start values in the controller's interface.toml refer to."""
    settings = SimpleNamespace(control=setup.control, period=setup.period, upright=UPRIGHT)
    gains = passive_gains(setup.robot) if setup.gains is None else setup.gains
    return SimpleNamespace(
        robot=setup.robot, gait=setup.gait, gains=gains, parts=setup.parts, settings=settings
    )


def controller_parameters(setup: ControllerSetup) -> dict[str, float]:
    """Returns all parameters of a controller's FMU by name. Raises the errors of `Controller`."""
    _build_kinematic(setup.robot, setup.gait, setup.period)
    return parameter_values(CONTROLLER, controller_roots(setup))


@lru_cache(maxsize=64)
def _build_kinematic(robot: Robot, gait: Gait, period: float) -> None:
    """Raises the errors of `Controller` that do not depend on the gains."""
    ControllerSetup(robot=robot, gait=gait, period=period).build()


def passive_gains(robot: Robot) -> SimpleNamespace:
    """Returns start values of the gains' parameters for kinematic control, which does not use them.

    They follow from the requirements.
    """
    return SimpleNamespace(**sections_for(robot, requirements_for(robot)))
