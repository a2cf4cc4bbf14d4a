"""Reads scenarios from TOML files and checks them key by key.

The settings of gait, terrain, contact, friction, servo, solver and baumgarte are those of robot
files; a scenario gives only what differs from the robot's own.

`gravity` is a number, along -z, or a vector in world axes [m/s2]. Plant and controller both use it:
the pose of rest, the gains' design, the planned loads and the weight in the metrics follow from it.
The FMU's parameters gravity[1] to gravity[3] are entries of the same key.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.controller import Parts
from hexapod_cosim.cosim.scenario.checks import check_interval, check_parameters, check_steps
from hexapod_cosim.cosim.scenario.controls import read_control
from hexapod_cosim.cosim.scenario.records import (
    CONTROLS,
    GRAVITY,
    GRAVITY_NAMES,
    KEYS,
    PLAIN_KEYS,
    SETTINGS,
    Outputs,
    Scenario,
    Sensors,
    Variation,
)
from hexapod_cosim.cosim.scenario.sections import (
    errors_of,
    read_commands,
    read_events,
    read_gains,
    read_gravity,
    read_setting,
    read_stance,
)
from hexapod_cosim.cosim.scenario.tables import read_overrides, read_tables, with_values
from hexapod_cosim.models import Robot, ScenarioError, load_robot
from hexapod_cosim.models.errors import check_type
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.ground.surface import Terrain
from hexapod_cosim.models.ground.table import merged_terrain
from hexapod_cosim.models.schema import (
    Number,
    expect_table,
    read_given,
    read_record,
    refuse_unknown_keys,
)
from hexapod_cosim.models.servos.presets import changed_servo
from hexapod_cosim.models.validation.bodies import check_settings

NUMBER = Number(GRAVITY.unit)


def load_scenario(path_or_name: str | Path, *, overrides: Sequence[str] = ()) -> Scenario:
    """Reads a scenario file, or a bundled scenario by name, and applies "NAME=VALUE" overrides.

    Raises ScenarioError.
    """
    what = "a list of texts NAME=VALUE"
    check_type(overrides, (list, tuple), what, where="overrides", error=ScenarioError)
    given = read_overrides(overrides)
    table, where = read_tables(path_or_name)
    return scenario_from_table(with_values(table, given), where=where, given=given)


def scenario_from_table(
    table: Mapping[str, Any], *, where: str, given: Collection[str] = (), option: str = "--set "
) -> Scenario:
    """Returns the checked scenario in the tables of a file. Raises ScenarioError.

    Messages name the file `where`, but `option` before one of the names `given`, which it set.
    """
    try:
        scenario = _read(table, where)
        check_steps(scenario)
        check_interval(scenario)
        check_parameters(scenario, given=given)
    except ScenarioError as error:
        key = (error.where or "").removeprefix(f"{where}: ")
        if f"{key}.{error.got}" in given:  # an unknown key
            key = f"{key}.{error.got}"
        if {key, key.partition("[")[0]} & set(given):  # also of an entry in a list
            error.where = f"{option}{key}"
        raise
    return scenario


def _read(table: Mapping[str, Any], where: str) -> Scenario:
    """Reads all keys. Raises ScenarioError."""
    with errors_of(where):
        refuse_unknown_keys(table, list(KEYS), "")
        plain = {key: value for key, value in table.items() if key in PLAIN_KEYS}
        plain = {"title": Path(where).stem, **read_given(Scenario, plain, "")}
        control, parameters = read_control(table.get("control", CONTROLS[0]), "control")
        scenario = Scenario(
            control=control.text,
            control_settings=parameters,
            gravity=read_gravity(table["gravity"], "gravity") if "gravity" in table else None,
            settings={
                name: read_setting(name, table[name], name) for name in SETTINGS if name in table
            },
            commands=read_commands(table.get("command", {}), "command"),
            events=read_events(table.get("events", [])),
            sensors=read_record(Sensors, table.get("sensors", {}), "sensors"),
            stance=read_stance(table.get("walk", {}), "walk"),
            gains=read_gains(table.get("gains", {}), "gains"),
            compliance=read_record(Parts, table.get("compliance", {}), "compliance"),
            variation=read_record(Variation, table["variation"], "variation")
            if "variation" in table
            else None,
            outputs=read_record(Outputs, table.get("outputs", {}), "outputs"),
            parameters=dict(expect_table(table.get("parameters", {}), "parameters")),
            where=where,
            **plain,
        )
    return _with_gravity_of_parameters(scenario)


def _with_gravity_of_parameters(scenario: Scenario) -> Scenario:
    """Moves the FMU parameters gravity[1] to gravity[3] of a scenario into its `gravity`."""
    names = [name for name in GRAVITY_NAMES if name in scenario.parameters]
    if not names:
        return scenario
    gravity = list(
        load_robot(scenario.robot).gravity if scenario.gravity is None else scenario.gravity
    )
    with errors_of(scenario.where):
        for name in names:
            value = NUMBER.read(scenario.parameters[name], f"parameters.{name}")
            gravity[GRAVITY_NAMES.index(name)] = value
    rest = {name: value for name, value in scenario.parameters.items() if name not in names}
    return replace(scenario, gravity=(gravity[0], gravity[1], gravity[2]), parameters=rest)


def scenario_robot(scenario: Scenario) -> Robot:
    """Returns the robot with the scenario's settings applied, but for the gait.

    The controller makes the gait. Raises RobotError when the settings do not fit together.
    """
    own = load_robot(scenario.robot)
    changes = {
        name: replace(getattr(own, name), **dict(values))
        for name, values in scenario.settings.items()
        if name not in ("gait", "terrain", "servo")
    }
    with errors_of(scenario.where):
        changes["servo"] = changed_servo(own.servo, scenario.settings.get("servo", {}), "servo")
    changes["terrain"] = scenario_terrain(scenario, own)
    friction = changes.get("friction", own.friction)
    if "mu_static" not in scenario.settings.get("friction", {}) and (
        not friction.has_friction or friction.mu_static < friction.mu
    ):
        # the robot file's mu_static belongs to another law or to a smaller mu
        changes["friction"] = replace(friction, mu_static=0.0)
    gravity = own.gravity if scenario.gravity is None else scenario.gravity
    robot = replace(own, **changes, gravity=gravity)
    if robot == own:
        return own
    if scenario.gravity is not None:
        _check_gravity(robot, where=f"{scenario.where}: gravity")
    _check_settings(robot, f"{scenario.where} with robot {robot.name}")
    return robot


@lru_cache(maxsize=64)
def _check_settings(robot: Robot, where: str) -> None:
    """Checks a robot's settings once for the many runs of a batch. Raises RobotError."""
    check_settings(robot, where=where)


def scenario_terrain(scenario: Scenario, own: Robot) -> Terrain:
    """Returns the ground of a scenario with its robot. Raises ScenarioError."""
    with errors_of(scenario.where):
        return merged_terrain(own.terrain, scenario.settings.get("terrain", {}), "terrain")


def _check_gravity(robot: Robot, *, where: str) -> None:
    """Raises ScenarioError for gravity that does not press the robot onto the ground."""
    if np.array(robot.gravity) @ ground_normal(robot.terrain) < 0.0:
        return
    fix = "write gravity = 1.62, or a vector that points down: [0, 0, -1.62]"
    expected = "gravity that presses the robot onto the ground [m/s2]"
    raise ScenarioError(
        "the robot cannot stand under this gravity",
        got=list(robot.gravity),
        expected=expected,
        fix=fix,
        where=where,
    )
