"""Writes a robot, its controller and a walking command as one package (SSP).

The command and all other chosen values are start values of the FMUs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.export.platforms import choose_platforms
from hexapod_cosim.cosim.export.ssp import export_ssp
from hexapod_cosim.cosim.export.start_values import with_starts
from hexapod_cosim.cosim.interface.controller import ControllerSetup, load_controller_interface
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.scenario.records import GRAVITY_NAMES
from hexapod_cosim.models import FmuError, HexapodError, unknown_name

PLANT, CONTROLLER = "plant", "controller"  # in the order of calculation
STOP = 10.0  # s
SPEED = 0.08  # m/s    straight ahead, as in the paper's experiment
WALK: Mapping[str, float] = MappingProxyType({"command.vx": SPEED})

NOTHING: Mapping[str, Any] = MappingProxyType({})
Values = Mapping[str, Mapping[str, float]]  # by component and name


def export_package(
    setup: ControllerSetup,
    path: str | Path,
    *,
    values: Values = NOTHING,
    stop: float = STOP,
    platforms: Iterable[str] | None = None,
    fmi: int = 2,
) -> Path:
    """Writes a package of plant FMU, controller FMU and their connections; returns its path.

    Args:
        setup: the controller and its robot.
        path: the file to write, atomically.
        values: of parameters and of the walking command, instead of the FMUs' start values and
            0.08 m/s straight ahead.
        stop: default stop time of the simulation [s].
        platforms: of both FMUs, as for `export_fmu`. At least one is required, since tools for
            packages do not compile sources.
        fmi: version of the FMUs. SSP 1.0 packs FMI 2.0, SSP 2.0 FMI 3.0.

    Raises the errors of `export_fmu`, `export_controller` and `export_ssp`; FmuError without a
    platform.
    """
    chosen = None if platforms is None else choose_platforms(platforms, fmi=fmi)
    if chosen == []:
        fix = "name platforms, or leave out --platforms for this machine's"
        raise FmuError(
            "a package of FMUs without binaries",
            got="--platforms sources",
            expected="a binary at least",
            fix=fix,
        )
    given = {
        PLANT: dict(values.get(PLANT, NOTHING)),
        CONTROLLER: {**WALK, **values.get(CONTROLLER, NOTHING)},
    }
    _refuse_driven(setup, given)
    with TemporaryFolder("package") as folder:
        files = {name: folder / f"{name}.fmu" for name in given}
        export_fmu(setup.robot, files[PLANT], platforms=chosen, fmi=fmi, starts=given[PLANT])
        export_controller(
            setup, files[CONTROLLER], platforms=chosen, fmi=fmi, starts=given[CONTROLLER]
        )
        return export_ssp(path, files, title=setup.robot.name, step=setup.period, stop=stop)


def _refuse_driven(setup: ControllerSetup, values: Values) -> None:
    """Raises FmuError for values of inputs that the other component sets."""
    parts = {PLANT: load_interface(setup.robot), CONTROLLER: load_controller_interface(setup)}
    for name, other in ((PLANT, CONTROLLER), (CONTROLLER, PLANT)):
        driven = {one.name for one in parts[other].of_causality("output")}
        with_starts(parts[name], values[name], driven=driven)


def read_values(texts: Iterable[str]) -> dict[str, dict[str, float]]:
    """Parses "COMPONENT.NAME=NUMBER" to values by component and name. Raises HexapodError."""
    found: dict[str, dict[str, float]] = {}
    for text in texts:
        where = f"--set {text}"
        name, _, number = (part.strip() for part in text.partition("="))
        component, _, variable = name.partition(".")
        if component not in {PLANT, CONTROLLER}:
            raise unknown_name("component", component, (PLANT, CONTROLLER), where=where)
        if variable in GRAVITY_NAMES:
            raise HexapodError(
                "gravity of one component alone",
                got=name,
                expected="the same for both",
                fix="write gravity = [0, 0, -1.62] into the robot's file: gains and the standing "
                "pose follow from it",
                where=where,
            )
        try:
            found.setdefault(component, {})[variable] = float(number)
        except ValueError as error:
            what, expected = "not a number", "COMPONENT.NAME=NUMBER"
            fix = "write --set controller.command.vx=0.05"
            raise HexapodError(what, got=number, expected=expected, fix=fix, where=where) from error
    return found
