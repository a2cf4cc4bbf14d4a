"""Makes the controller of a run: a built-in one, an object of the user's class, or an FMU."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import Controller, ControllerError
from hexapod_cosim.cosim.control.fmu_instance import open_controller_fmu, refuse_crashing
from hexapod_cosim.cosim.control.fmu_law import FmuLaw
from hexapod_cosim.cosim.control.python_law import (
    PythonLaw,
    build,
    file_of,
    load_class,
    parameters_of,
)
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.cosim.master.connection import Connection, connect, names_of_map, read_map
from hexapod_cosim.cosim.master.fmu_block import FmuVariable
from hexapod_cosim.cosim.scenario.controls import (
    FMU,
    MAP,
    PYTHON,
    Control,
    control_of,
    parse_control,
)
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import FmuError, HexapodError, suggestion


@contextmanager
def make_controller(
    scenario: Scenario, setup: ControllerSetup, *, law: Any = None
) -> Iterator[Controller | PythonLaw | FmuLaw]:
    """Makes the controller of a run and frees it at the end of the block.

    All have the method `step` and `warnings`; a controller FMU is to be started before.

    Args:
        scenario: of the run.
        setup: robot, gait, period, gains and parts.
        law: an object with the method `step`, or a class of such objects, which replaces the
            scenario's control.

    Raises:
        ControllerError: the user's class cannot be made.
        FmuError: the FMU cannot be opened or connected.
    """
    chosen = control_of(scenario.control)
    if law is not None:
        yield _given_law(law, setup, scenario)
    elif chosen.kind == PYTHON and chosen.path is not None:
        yield _python_law(chosen, chosen.path, setup, scenario)
    elif chosen.kind == FMU and chosen.path is not None:
        fmu = open_controller_fmu(chosen.path)
        try:
            fmu.set_parameters(fmu_parameters_of(chosen, fmu.described, scenario))
            connection = connection_of(chosen, fmu.described, scenario, setup)
            yield FmuLaw(fmu, connection, period=setup.period)
        finally:
            fmu.close()
    elif chosen.is_builtin:
        yield setup.build()
    else:
        raise ControllerError(
            "the controller was an object of a Python program",
            got=chosen.text,
            expected="law.py:Class or controller.fmu",
            fix="name the file of its class with --control",
            where=scenario.where,
        )


def arguments_of(setup: ControllerSetup) -> dict[str, Any]:
    """Returns the arguments that any user's class may ask for by name."""
    return {"robot": setup.robot, "period": setup.period, "gait": setup.gait}


def _python_law(
    control: Control, path: Path, setup: ControllerSetup, scenario: Scenario
) -> PythonLaw:
    law = load_class(path, control.name)
    settings = settings_for(scenario, control.label)
    return PythonLaw(build(law, path, arguments_of(setup), settings), path=path)


def _given_law(law: Any, setup: ControllerSetup, scenario: Scenario) -> PythonLaw:
    """Returns the controller for an object or a class that a caller gave."""
    if isinstance(law, type):
        path = file_of(law) or Path("<notebook>")
        settings = settings_for(scenario, control_of(scenario.control).label)
        return PythonLaw(build(law, path, arguments_of(setup), settings))
    if not callable(getattr(law, "step", None)):
        raise ControllerError(
            "not a controller",
            got=type(law).__name__,
            expected="a control's text, a class, or an object with step(t, command, measurement)",
            fix='write controller="law.py:Class"',
        )
    return PythonLaw(law)


def settings_for(scenario: Scenario, label: str) -> dict[str, Any]:
    """Returns the parameters of [control] for one label; those of [control.LABEL] come first.

    Other tables are left out: they belong to other labels.
    """
    table = scenario.control_settings
    own = table.get(label, {})
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    return {**plain, **(own if isinstance(own, Mapping) else {})}


def _map_for(scenario: Scenario, path: Path) -> dict[str, str]:
    """Returns the FMU's names by ours: of the file beside it, and of [control.map]."""
    found: dict[str, str] = {}
    for names, where in (
        (read_map(path), str(path.with_suffix(".toml"))),
        (scenario.control_settings.get(MAP, {}), f"{scenario.where}: control.map"),
    ):
        if not isinstance(names, Mapping):
            raise FmuError("wrong type", got=names, expected="a table of names", where=where)
        found |= names_of_map(names, where=where)
    return found


def connection_of(
    control: Control, variables: Sequence[FmuVariable], scenario: Scenario, setup: ControllerSetup
) -> Connection:
    """Returns the connection of a controller FMU with the plant. Raises FmuError."""
    path = control.path or Path(control.name)
    torque = setup.robot.servo.mode == "torque"
    return connect(variables, _map_for(scenario, path), torque=torque, where=str(path))


def fmu_parameters_of(
    control: Control, variables: Sequence[FmuVariable], scenario: Scenario
) -> dict[str, Any]:
    """Returns the parameters of [control] that a controller FMU has."""
    names = {item.name for item in variables if item.causality == "parameter"}
    settings = settings_for(scenario, control.label)
    return {name: value for name, value in settings.items() if name in names}


@dataclass(frozen=True)
class Taken:
    """The parameters that a control takes from [control]."""

    names: tuple[str, ...]
    every: bool  # whether it takes any name


def taken_parameters(control: Control) -> Taken:
    """Returns which keys of [control] a control takes. Raises HexapodError for a bad file."""
    if control.kind == PYTHON and control.path is not None:
        named, every = parameters_of(load_class(control.path, control.name))
        return Taken(tuple(named), every)
    if control.kind == FMU and control.path is not None:
        description = open_description(control.path)
        names = [v.name for v in description.modelVariables if v.causality == "parameter"]
        return Taken(tuple(names), False)
    return Taken((), False)


def check_control(scenario: Scenario, controls: Iterable[Control]) -> None:
    """Checks, before any run, that the files of controls can be read and take all parameters, and
    that no FMU ends the process which loads it.

    A plain key of [control] must be a parameter of one of the controls, a key of [control.LABEL]
    one of that label. Raises HexapodError.
    """
    found: dict[str, Taken] = {}
    for control in controls:
        if control.kind == FMU and control.path is not None:
            refuse_crashing(control.path)
        found[control.label] = taken_parameters(control)
    table = scenario.control_settings
    plain = [key for key, value in table.items() if not isinstance(value, Mapping)]
    _check_taken(plain, list(found.values()), f"{scenario.where}: control")
    for label, own in table.items():
        if label in found and isinstance(own, Mapping):
            _check_taken(list(own), [found[label]], f"{scenario.where}: control.{label}")


def _check_taken(names: Sequence[str], found: Sequence[Taken], where: str) -> None:
    """Raises ControllerError for a name that no control takes."""
    known = [name for item in found for name in item.names]
    for name in names:
        if name not in known and not any(item.every for item in found):
            raise ControllerError(
                "no control takes this parameter",
                got=name,
                expected=f"one of {', '.join(known)}" if known else "no parameter",
                fix=suggestion(name, known, otherwise="take it away"),
                where=where,
            )


def control_facts(scenario: Scenario, law: Any = None) -> dict[str, Any]:
    """Returns what run.json tells about a run's control besides its label."""
    if law is not None:
        kind = law if isinstance(law, type) else type(law)
        return {"kind": "object", "class": f"{kind.__module__}.{kind.__qualname__}"}
    control = control_of(scenario.control)
    facts: dict[str, Any] = {"kind": control.kind, "text": control.text}
    if control.path is not None:
        facts["sha256"] = _file_hash(control.path)
    if scenario.control_settings:
        facts["parameters"] = dict(scenario.control_settings)
    return facts


def _file_hash(path: Path) -> str:
    """Returns the SHA-256 of a control's file, in hex. Raises HexapodError."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        what, fix = "cannot read the control's file", "leave it in its place during the run"
        raise HexapodError(what, got=error.strerror, fix=fix, where=str(path)) from error


def text_of_law(law: Any, label: str | None = None) -> str:
    """Returns the text of the control for a class or an object that a Python program gives.

    Raises ScenarioError for a label that cannot name a folder.
    """
    name = (law if isinstance(law, type) else type(law)).__name__
    text = f"object:{name}" if label is None else f"{label}=object:{name}"
    return parse_control(text, where="controller").text
