"""Gains for a robot from its own FMU: exported, linearised in all its stances, designed for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

from hexapod_cosim.controller import Gains, GainsError, Requirements
from hexapod_cosim.controller.design import StandingPlant, design_gains
from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.fmu import Fmu
from hexapod_cosim.cosim.linearise import linearise, rest
from hexapod_cosim.models import LEG_NAMES, Robot, unknown_name

STANCES: Mapping[str, Sequence[str]] = {"six legs": LEG_NAMES, "tripod LF LR RM": ("LF", "LR", "RM"), "tripod LM RF RR": ("LM", "RF", "RR")}
LOADS = (0.1, 1.0, 2.0)  # 1    mean load of the standing legs, in thirds of the weight


def design_for(robot: Robot, period: float, requirements: Requirements | None = None) -> Gains:
    """Gains of a robot for a controller period [s]. Raises GainsError, FmuError."""
    with threadpool_limits(1):  # its matrices are small: threads would wait for each other longer than they compute
        return design_gains(robot, period, plants=standing_plants(robot, period), requirements=requirements)


def standing_plants(robot: Robot, period: float) -> dict[str, StandingPlant]:
    """The robot's FMU on level ground, linearised in its stances, under light and heavy loads, with its gears' friction and without.

    A gear's friction is a strong damper at standstill and none at walking speed. Raises GainsError for a robot or a period that no gains
    can be designed for.
    """
    if not period > 0.0:
        raise GainsError("impossible controller period", got=period, expected="a number > 0", fix="give it in seconds")
    plants: dict[str, StandingPlant] = {}
    with level_fmu(robot) as fmu:
        for stance, standing in STANCES.items():
            for load in LOADS:
                motion, inputs = rest(fmu, robot, standing=standing, load=load)
                for gears, friction in (("gears stick", robot.servo.coulomb_friction), ("gears slip", 0.0)):
                    plant = linearise(fmu, robot, motion, inputs, period=period, coulomb_friction=friction)
                    plants[f"{stance}, load {load:g}, {gears}"] = plant
    return plants


@contextmanager
def level_fmu(robot: Robot) -> Iterator[Fmu]:
    """The robot's FMU on level ground at height 0, exported for the occasion. Raises GainsError for a robot without position servos."""
    if robot.servo.mode != "position" or robot.servo.kp <= 0.0:
        raise GainsError(
            "compliant control shifts the servos' targets", got=f"servo mode {robot.servo.mode}, kp {robot.servo.kp}",
            expected="servo mode position with kp > 0", fix="use position servos, or kinematic control",
        )  # fmt: skip
    level = replace(robot, terrain=replace(robot.terrain, kind="flat", height=0.0))
    with TemporaryDirectory(prefix="hexapod-") as folder, Fmu(export_fmu(level, Path(folder) / f"{robot.name}.fmu")) as fmu:
        yield fmu


def read_requirements(settings: Sequence[str]) -> Requirements:
    """The default requirements with `NAME=VALUE` settings in their place. Raises GainsError: the setting, what is wrong with it."""
    names, values = [entry.name for entry in fields(Requirements)], {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in names:
            raise unknown_name("requirement", name, names, error=GainsError)
        try:
            values[name] = float(text)
        except ValueError as error:
            raise GainsError("not a number", got=text, expected=f"{name}=NUMBER", fix="give a number in SI units", where=name) from error
    return Requirements(**values)
