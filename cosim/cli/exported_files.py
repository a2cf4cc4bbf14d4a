"""Writes FMUs, packages and robot descriptions, for `hexapod export`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

from hexapod_cosim.controller import Gait, load_gains
from hexapod_cosim.cosim.cli.terminal import refuse_unused, show_files, show_json, waiting, warn
from hexapod_cosim.cosim.cli.terrains import surfaces_from
from hexapod_cosim.cosim.common.files import write_text, writing_into
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.export.robot_package import export_package, read_values
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.scenario.records import CHOSEN, OWN
from hexapod_cosim.models import HexapodError, Robot, load_robot, unknown_name
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.urdf.writer import robot_to_urdf

FORMATS: dict[str, Callable[[Robot], str]] = {"urdf": robot_to_urdf, "mjcf": robot_to_mjcf}
SUFFIXES = {"urdf": ".urdf", "mjcf": ".xml", "ssp": ".ssp"}  # of what is no FMU
DEFAULT_CONTROL = "compliant"  # of a package
CONTROLLER_OPTIONS = ("gait", "gains", "period")
DESCRIPTION, PLANT_FMU = "a robot's description", "the plant's FMU"
CONTROLLER_FMU, PACKAGE = "a controller's FMU", "a package"
# options without effect, by what is written
UNUSED_OPTIONS = {
    DESCRIPTION: (*("fmi", "platforms", "terrain", "stance", "controller"), *CONTROLLER_OPTIONS),
    PLANT_FMU: CONTROLLER_OPTIONS,
    CONTROLLER_FMU: ("terrain",),
    PACKAGE: ("terrain",),
}


@dataclass(frozen=True, kw_only=True)
class Request:
    """The options of the command line."""

    context: typer.Context
    output: Path | None
    robot: str
    fmi: int
    platforms: list[str] | None
    urdf: bool
    mjcf: bool
    ssp: bool
    values: Sequence[str]
    terrains: Sequence[str]
    controller: str | None
    gait: str | None
    stance: str
    gains: Path | None
    period: float  # s


def write_export(request: Request, *, as_json: bool) -> None:
    """Writes what was asked for and prints its path. Raises HexapodError."""
    robot, kind, control = load_robot(request.robot), _chosen_kind(request), request.controller
    if kind == "ssp":
        control, written = control or DEFAULT_CONTROL, PACKAGE
    elif kind == "fmu":
        written = PLANT_FMU if control is None else CONTROLLER_FMU
    else:
        written = DESCRIPTION
    _refuse_unused_options(request.context, written)
    robot, gait = _in_stance(robot, request.stance)
    name = f"{robot.name}_controller" if written == CONTROLLER_FMU else robot.name
    path = _path(request.output, name, SUFFIXES.get(kind, ".fmu"))
    if written == DESCRIPTION:
        export_description(robot, path, FORMATS[kind])
    else:
        setup = None if control is None else _controller_setup(robot, request, control, gait)
        with waiting("compiling" if request.platforms else None):
            _export_fmu(robot, setup, request, path)
    if as_json:
        show_json({kind: str(path), "robot": robot.name, "hash": robot.hash})
        return
    show_files([path])
    for key, text in robot.source.items():
        if key.startswith("URDF, "):  # what was assumed when it was read
            print(text)


def _chosen_kind(request: Request) -> str:
    """Returns urdf, mjcf, ssp or fmu, by option or else by the file's suffix.

    Raises HexapodError for two options, and for values of anything but a package.
    """
    wanted = [kind for kind in SUFFIXES if getattr(request, kind)]
    if len(wanted) > 1:
        raise HexapodError(
            "two formats at once",
            got=" ".join(f"--{kind}" for kind in wanted),
            expected="one of them",
            fix="run the command twice",
        )
    suffix = request.output.suffix if request.output is not None else ""
    named = [kind for kind, own in SUFFIXES.items() if own == suffix]
    kind = [*wanted, *named, "fmu"][0]
    if request.values and kind != "ssp":
        fix = "add --ssp; a robot's own values belong into its file"
        got = request.values[0]
        raise HexapodError("--set without a package", got=got, expected="--ssp", fix=fix)
    return kind


def _refuse_unused_options(context: typer.Context, written: str) -> None:
    """Raises HexapodError for given options that have no effect on what is written."""
    fix = "leave them out"
    if written == PLANT_FMU:
        fix += ", or add --controller kinematic or compliant"
    names = {name: f"--{name}" for name in UNUSED_OPTIONS[written]}
    refuse_unused(context, names, written=written, fix=fix)


def _in_stance(robot: Robot, stance: str) -> tuple[Robot, Gait | None]:
    """Returns the robot in a stance, and the gait that belongs to it; None: the robot file's.

    Raises HexapodError for an unknown stance.
    """
    if stance not in (OWN, CHOSEN):
        raise unknown_name("stance", stance, (OWN, CHOSEN))
    if stance == OWN:
        return robot, None
    from hexapod_cosim.cosim.run.gait_selection import compliant_gait

    with waiting("choosing the stance"):
        walk = compliant_gait(robot)
    return walk.robot, walk.gait


def _export_fmu(robot: Robot, setup: ControllerSetup | None, request: Request, path: Path) -> None:
    """Writes the plant's FMU, or with a setup the controller's or a package of both."""
    fmi, platforms = request.fmi, request.platforms
    if setup is None:
        terrains = surfaces_from(request.terrains)
        export_fmu(robot, path, fmi=fmi, platforms=platforms, terrains=terrains)
    elif path.suffix == SUFFIXES["ssp"]:
        values = read_values(request.values)
        export_package(setup, path, values=values, platforms=platforms, fmi=fmi)
    else:
        export_controller(setup, path, fmi=fmi, platforms=platforms)


def _path(output: Path | None, name: str, suffix: str) -> Path:
    """Returns the file to write. Raises HexapodError for a folder or another suffix."""
    path = output or Path(f"{name}{suffix}")
    if path.is_dir() or path.suffix != suffix:
        right = path / f"{name}{suffix}" if path.is_dir() else path.with_suffix(suffix)
        raise HexapodError(
            "not the name of such a file",
            got=str(path),
            expected=f"a file that ends in {suffix}",
            fix=f"write -o {right}",
        )
    return path


def _controller_setup(
    robot: Robot, request: Request, control: str, gait: Gait | None
) -> ControllerSetup:
    """Builds the controller's setup; shows a warning for gains of another robot or period."""
    from hexapod_cosim.cosim.run.plan import make_setup

    gains = None if request.gains is None else load_gains(request.gains)
    designs = control != "kinematic" and gains is None
    with waiting("designing the gains" if designs else None):
        setup = make_setup(
            robot, control=control, period=request.period, gait=request.gait or gait, gains=gains
        )
    for warning in setup.build().warnings:
        warn(warning)
    return setup


def export_description(robot: Robot, path: Path, render: Callable[[Robot], str]) -> Path:
    """Writes a robot's file atomically and returns its path.

    Raises HexapodError when the file cannot be written.
    """
    with writing_into(path.parent):
        write_text(path, render(robot))
    return path
