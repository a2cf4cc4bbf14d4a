"""Controller FMUs of tests, and walks of one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from gains import PERIOD, make_gains

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.cosim.master.signals import COMMANDS
from hexapod_cosim.cosim.run.gait_selection import known_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import load_robot

ANGLE, SPEED = 1e-12, 1e-12  # rad; of a servo's largest


def setup_for(scenario: Scenario) -> ControllerSetup:
    robot = known_robot(scenario)
    gains = (
        None if scenario.control == "kinematic" else make_gains(robot, period=scenario.macro_step)
    )
    return ControllerSetup(
        robot=robot,
        gait=make_gait(robot, **dict(scenario.settings.get("gait", {}))),
        period=scenario.macro_step,
        gains=gains,
        parts=scenario.compliance,
    )


@contextmanager
def packed(
    setup: ControllerSetup,
    folder: Path,
    *,
    start: float = 0.0,
    stop: float = 60.0,
    **parameters: object,
) -> Iterator[Fmu]:
    """Yields the initialized controller FMU of a setup."""
    with Fmu(export_controller(setup, folder / "controller.fmu"), name="controller") as fmu:
        fmu.set_parameters({name.replace("__", "."): value for name, value in parameters.items()})
        fmu.initialise(start, stop)
        yield fmu


def outputs(fmu: Fmu) -> np.ndarray:
    """Returns all Real outputs."""
    block = fmu.block(fmu.names("output"))
    block.get()
    return block.values.copy()


def give(fmu: Fmu, **values: float) -> None:
    """Sets inputs by name, with dots as a__b and brackets as a_1."""
    block = fmu.block([name.replace("__", ".") for name in values])
    block.values[:] = list(values.values())
    block.set()


def walk(fmu: Fmu, first: int, count: int, *, h: float = PERIOD) -> np.ndarray:
    """Returns outputs at communication points of a walk with unequal forces on the feet."""
    robot, found = load_robot("athena"), []
    block = fmu.block(
        [
            *COMMANDS,
            *(name for key in ("angle", "foot_force", "quaternion") for name in MEASURED[key]),
        ]
    )
    draws = np.random.default_rng(5).normal(size=(first + count, 6, 3))
    for k in range(first, first + count):
        force = draws[k] + [0.0, 0.0, 8.0]
        block.values[:] = np.concatenate(
            [
                [0.05, 0.0, 0.02, 0.0, 0.0, 0.0],
                robot.stance.ravel(),
                force.ravel(),
                [1.0, 0.0, 0.0, 0.0],
            ]
        )
        block.set()
        found.append(outputs(fmu))
        fmu.step(k * h, h)
    return np.array(found)
