"""Designs gains for a robot from its own FMU, linearised in all its stances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace

import numpy as np
from threadpoolctl import threadpool_limits

from hexapod_cosim.controller import Gains, GainsError, Requirements
from hexapod_cosim.controller.design import StandingPlant, design_gains
from hexapod_cosim.controller.design.synthesis import check_period, check_position_servos
from hexapod_cosim.controller.gains_file import raising_gains_errors
from hexapod_cosim.controller.size import requirements_for
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.design.linearise import Motion, linearise
from hexapod_cosim.cosim.design.standing import StanceError, rest
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import LEG_NAMES, Robot, unknown_name
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.schema import specs

STANCES: Mapping[str, Sequence[str]] = {
    "six legs": LEG_NAMES,
    "tripod LF LR RM": ("LF", "LR", "RM"),
    "tripod LM RF RR": ("LM", "RF", "RR"),
}
OWN_WEIGHT = 1.0
LOADS = (0.1, OWN_WEIGHT, 2.0)  # 1    mean load of the standing legs, in thirds of the weight


def design_for(robot: Robot, period: float, requirements: Requirements | None = None) -> Gains:
    """Designs gains of a robot for a controller period [s]. Raises GainsError, FmuError."""
    with threadpool_limits(1):  # for small matrices, threads cost more time than they save
        plants, left_out = examine_stances(robot, period)
        return design_gains(
            robot, period, plants=plants, requirements=requirements, left_out=left_out
        )


def examine_stances(
    robot: Robot, period: float
) -> tuple[dict[str, StandingPlant], tuple[str, ...]]:
    """Linearises the robot's FMU on level ground in its stances, under light and heavy loads.

    Each is linearised with the friction of its gears and without: that friction is a strong damper
    at standstill and none at walking speed. Stances and loads in which the robot does not stand are
    left out; the returned texts name them, with the reason. Raises GainsError for a robot that
    stands in no stance, and for a robot or a period that no gains can be designed for.
    """
    _check_can_design(robot, period)
    plants: dict[str, StandingPlant] = {}
    failures: dict[str, StanceError] = {}
    frictions = {"gears stick": robot.servo.coulomb_friction, "gears slip": 0.0}
    with level_fmu(robot) as fmu:
        for stance, standing in STANCES.items():
            for load, (motion, inputs) in _rests(fmu, robot, stance, standing, failures).items():
                for gears, friction in frictions.items():
                    plants[f"{stance}, load {load:g}, {gears}"] = linearise(
                        fmu, robot, motion, inputs, period=period, coulomb_friction=friction
                    )
    if not plants:
        first = failures[next(iter(STANCES))]
        raise GainsError(
            "the robot does not stand",
            got=f"{first.what}: {first.got}",
            expected="rest on six legs or on one of its tripods",
            fix=first.fix,
            where=robot.name,
        )
    return plants, tuple(
        f"{name}: {error.what} (got {error.got}, expected {error.expected})"
        for name, error in failures.items()
    )


def _check_can_design(robot: Robot, period: float) -> None:
    """Raises GainsError for an impossible period and for feet without friction."""
    check_period(period)
    if not robot.friction.has_friction or robot.friction.mu == 0.0:
        raise GainsError(
            "compliant control answers to the feet's friction",
            got=f"friction law {robot.friction.law}, mu {robot.friction.mu}",
            expected="a robot file whose feet have friction",
            fix="give the file the friction of ordinary ground, and a scenario friction.mu = 0",
            where=robot.name,
        )


def _rests(
    fmu: Fmu, robot: Robot, stance: str, standing: Sequence[str], failures: dict[str, StanceError]
) -> dict[float, tuple[Motion, Array]]:
    """Returns the robot at rest under each load that it can stand under, with its inputs.

    Returns {} when it cannot stand under its own weight. Adds the reasons to `failures`.
    """
    found: dict[float, tuple[Motion, Array]] = {}
    for load in sorted(LOADS, key=lambda load: load != OWN_WEIGHT):
        try:
            found[load] = rest(fmu, robot, standing=standing, load=load)
        except StanceError as error:
            name = stance if load == OWN_WEIGHT else f"{stance} under {load:g} times its weight"
            failures[name] = error
            if load == OWN_WEIGHT:
                return {}
    return {load: found[load] for load in LOADS if load in found}


@contextmanager
def level_fmu(robot: Robot) -> Iterator[Fmu]:
    """Exports the robot's FMU on level ground at height 0 and opens it.

    Raises GainsError for a robot without position servos.
    """
    check_position_servos(robot)
    # level ground is normal to gravity
    down = (0.0, 0.0, -float(np.linalg.norm(robot.gravity)))
    level = replace(robot, gravity=down, terrain=replace(robot.terrain, kind="flat", height=0.0))
    with (
        TemporaryFolder("export") as folder,
        Fmu(export_fmu(level, folder / f"{robot.name}.fmu", bare=True)) as fmu,
    ):
        yield fmu


def read_requirements(settings: Sequence[str], robot: Robot) -> Requirements:
    """Returns a robot's requirements with settings `NAME=VALUE` applied.

    Raises GainsError, which names the setting.
    """
    names, values = [entry.name for entry in fields(Requirements)], {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in names:
            raise unknown_name("requirement", name, names, error=GainsError)
        try:
            values[name] = float(text)
        except ValueError as error:
            raise GainsError(
                "not a number",
                got=text,
                expected=f"{name}=NUMBER",
                fix="give a number in SI units",
                where=name,
            ) from error
    with raising_gains_errors():
        checked = {name: specs(Requirements)[name].read(values[name], name) for name in values}
    return requirements_for(robot, **checked)
