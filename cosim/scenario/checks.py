"""Checks a scenario across its keys: duration against macro-step, names of FMU parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from hexapod_cosim.controller import Parts
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.cosim.scenario.events import ServoFault, Tuning
from hexapod_cosim.cosim.scenario.records import (
    MAX_STEPS,
    SETTINGS,
    UNUSED,
    WALK_KEYS,
    Command,
    Outputs,
    Scenario,
    Sensors,
    Variation,
)
from hexapod_cosim.cosim.scenario.sections import GAINS
from hexapod_cosim.models import Robot, ScenarioError, load_robot, suggestion
from hexapod_cosim.models.ground.table import terrain_specs
from hexapod_cosim.models.schema import specs

WHOLE_STEPS_TOLERANCE = 1e-6  # of a macro-step: allows for the round-off of a decimal duration


def check_steps(scenario: Scenario) -> None:
    """Checks that the duration is a whole number of macro-steps from 1 to MAX_STEPS.

    Raises ScenarioError.
    """
    h, where = scenario.macro_step, f"{scenario.where}: duration"
    if scenario.duration / h > MAX_STEPS * (1.0 + WHOLE_STEPS_TOLERANCE):
        expected = f"at most {MAX_STEPS} macro-steps, {MAX_STEPS * h:g} s with macro_step = {h:g} s"
        fix = "shorten the duration or lengthen macro_step"
        raise ScenarioError(
            "too many macro-steps", got=scenario.duration, expected=expected, fix=fix, where=where
        )
    _check_multiple(scenario.duration, max(scenario.steps, 1), h, where)


def check_interval(scenario: Scenario) -> None:
    """Checks that `outputs.interval` is a whole number of macro-steps. Raises ScenarioError."""
    interval, where = scenario.outputs.interval, f"{scenario.where}: outputs.interval"
    if interval:
        hint = "; 0 keeps every macro-step"
        _check_multiple(interval, scenario.every, scenario.macro_step, where, hint)


def _check_multiple(time: float, steps: int, h: float, where: str, hint: str = "") -> None:
    """Raises ScenarioError for a time [s] that is not so many macro-steps h [s] long."""
    if abs(time / h - steps) > WHOLE_STEPS_TOLERANCE * steps:
        expected, fix = f"a multiple of macro_step = {h:g} s", f"{steps * h:g} is the nearest{hint}"
        what = "not a whole number of macro-steps"
        raise ScenarioError(what, got=time, expected=expected, fix=fix, where=where)


def check_servo_faults(scenario: Scenario, robot: Robot) -> None:
    """Refuses faults of kinematic drives, which move by prescribed angles without torques.

    Raises ScenarioError.
    """
    faults = scenario.events_of(ServoFault)
    if faults and robot.servo.mode == "kinematic":
        raise ScenarioError(
            "a fault of a servo of a kinematic drive",
            got=f"{faults[0].leg}.{faults[0].joint} {faults[0].fault} at {faults[0].time:g} s",
            expected="servo.mode torque or position",
            fix="set servo.mode=torque",
            where=f"{scenario.where}: events",
        )


def check_parameters(scenario: Scenario, *, given: Collection[str]) -> None:
    """Checks that the names in `parameters` are parameters of the robot's FMU.

    `given` are the names of settings, as which messages name them. Raises ScenarioError.
    """
    if not scenario.parameters and not scenario.events_of(Tuning):
        return
    interface = load_interface(load_robot(scenario.robot))
    known = [entry.name for entry in interface.of_causality("parameter")]
    others = {
        entry.name: entry.causality
        for entry in interface.variables
        if entry.causality in {"input", "output"}
    }
    _check_tunings(scenario, interface)
    for name, value in scenario.parameters.items():
        if name in known:
            continue
        where = f"{scenario.where}: {name if name in given else 'parameters'}"
        if name in others:
            raise _not_a_parameter(name, others[name], where)
        if name in given:
            valid = [*setting_names(), *known]
            expected = "a key of the scenario or a parameter"
            raise _unknown("setting", name, valid, expected, where=where)
        if isinstance(value, Mapping):
            raise ScenarioError(
                "a table where a parameter should be",
                got=name,
                expected="NAME = VALUE",
                fix='write names with dots in quotes: "torso.mass" = 2.7',
                where=where,
            )
        raise _unknown("parameter", name, known, "a parameter", where=where)


def _check_tunings(scenario: Scenario, interface: Interface) -> None:
    """Checks that events give tunable parameters values in range. Raises ScenarioError."""
    tunable = [entry.name for entry in interface.variables if entry.variability == "tunable"]
    fixed = {entry.name for entry in interface.of_causality("parameter")} - set(tunable)
    for event in scenario.events_of(Tuning):
        where = f"{scenario.where}: events"
        if event.parameter in fixed:
            raise ScenarioError(
                "an event on a fixed parameter",
                got=event.parameter,
                expected="a tunable one: masses, inertias, gravity, contact, friction, servo gains",
                fix="set it from the start, in [parameters]",
                where=where,
            )
        if event.parameter not in tunable:
            raise _unknown(
                "tunable parameter", event.parameter, tunable, "a tunable one", where=where
            )
        name = f"{scenario.where}: event at {event.time:g} s: {event.parameter}"
        interface.by_name[event.parameter].check(event.value, ScenarioError, name=name)


def _not_a_parameter(name: str, causality: str, where: str) -> ScenarioError:
    """Returns the error for an input or output of the FMU under `parameters`."""
    fix = "set a parameter"
    if name.startswith("torso.push"):
        fix = "use [[events]]: --set 'events=[{time=1, duration=0.1, force=[0, 40, 0]}]'"
    expected = f"a parameter of the FMU; this is an {causality}"
    return ScenarioError("not a parameter", got=name, expected=expected, fix=fix, where=where)


def _unknown(kind: str, name: str, valid: list[str], expected: str, *, where: str) -> ScenarioError:
    """Returns the error for an unknown name, as `unknown_name` but without the long list."""
    otherwise = "the FMU's documentation lists the parameters"
    fix = suggestion(name, valid, otherwise=otherwise)
    return ScenarioError(
        f"unknown {kind}", got=name, expected=f"{expected} of the FMU", fix=fix, where=where
    )


def setting_names() -> list[str]:
    """Returns the scenario's dotted keys."""
    records = {"command": Command, "sensors": Sensors, "variation": Variation, **SETTINGS}
    records |= {"outputs": Outputs, "compliance": Parts}
    keys = [("terrain", key) for key in (*terrain_specs(), "patch")]
    keys += [
        (section, key)
        for section, record in records.items()
        for key in specs(record)
        if section != "terrain" and key not in UNUSED.get(section, ())
    ]
    keys += [("walk", key) for key in WALK_KEYS]
    keys += [("gains", f"{part}.{key}") for part, kind in GAINS.items() for key in specs(kind)]
    return [f"{section}.{key}" for section, key in keys]
