"""Defines `hexapod export`, which writes FMUs, packages and robot descriptions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.controller import Gait
from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.running import GainsFile, given_gains
from hexapod_cosim.cosim.cli.terminal import (
    Json,
    refuse_unused,
    show_files,
    show_json,
    waiting,
    warn,
)
from hexapod_cosim.cosim.cli.terrain_command import surfaces_from
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.export.robot_files import (
    Format,
    chosen_format,
    export_description,
    left_out,
)
from hexapod_cosim.cosim.export.robot_package import (
    chosen_package,
    export_package,
    package_path,
    read_values,
)
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.run.chosen_walk import chosen_walk
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.cosim.scenario.records import CHOSEN, CONTROLS, OWN
from hexapod_cosim.models import HexapodError, Robot, load_robot, unknown_name
from hexapod_cosim.models.ground.surface import Surface

RobotName = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="A robot file, a URDF, or a name of `hexapod list robots`.",
        autocompletion=completion.robot,
    ),
]
OutputFile = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        help="The file to write; default ROBOT.fmu, .ssp, .urdf or .xml.",
    ),
]
FmiVersion = Annotated[int, typer.Option("--fmi", help="Version of the standard: 2 or 3.")]
Platforms = Annotated[
    str | None,
    typer.Option(
        "--platforms",
        help="Cross-compile for these, separated by commas (linux64, win64, darwin64, "
        "aarch64-linux, or FMI 3's names of them) or all; sources: no binary. "
        "Default: this machine's installed one.",
    ),
]
Integers = Annotated[
    bool,
    typer.Option(
        "--integers",
        help="Offer integers instead of enumerations, for importers that have none.",
    ),
]
Urdf = Annotated[
    bool, typer.Option("--urdf", help="Write the robot as a URDF instead; so does -o FILE.urdf.")
]
Mjcf = Annotated[
    bool, typer.Option("--mjcf", help="Write it as a MuJoCo model instead; so does -o FILE.xml.")
]
Ssp = Annotated[
    bool,
    typer.Option(
        "--ssp",
        help="Write plant and controller, connected and walking, as a package (SSP); so does "
        "-o FILE.ssp.",
    ),
]
Values = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Of the package: controller.command.vx=0.05, plant.friction.mu=0.5, ...",
    ),
]
Terrains = Annotated[
    list[str] | None,
    typer.Option(
        "--terrain",
        metavar="NAME[:KEY=VALUE,...]",
        help="Pack a surface of `hexapod list terrains` into the plant's FMU; repeat it for "
        "several, between which the parameter terrain.grid chooses.",
        autocompletion=completion.surface,
    ),
]
ControllerName = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="|".join(CONTROLS),
        help="Pack the robot's controller instead of the plant.",
        autocompletion=completion.control,
    ),
]
GaitName = Annotated[
    str | None,
    typer.Option(
        "--gait",
        help="Of the controller: one of `hexapod list gaits`.",
        autocompletion=completion.gait,
    ),
]
StanceName = Annotated[
    str,
    typer.Option(
        "--stance",
        metavar="own|chosen",
        help="own: stance and gait of the robot file. chosen: those in which compliant control "
        "walks; export plant and controller in the same.",
    ),
]
Period = Annotated[float, typer.Option("--period", help="Of the controller [s].")]

DEFAULT_PERIOD = 0.005  # s, the default macro-step
DEFAULT_CONTROL = "compliant"  # of a package
CONTROLLER_OPTIONS = ("gait", "gains", "period")
DESCRIPTION, PLANT_FMU = "a robot's description", "the plant's FMU"
CONTROLLER_FMU, PACKAGE = "a controller's FMU", "a package"
# options without effect, by what is written
UNUSED_OPTIONS = {
    DESCRIPTION: (
        "fmi",
        "platforms",
        "integers",
        "terrain",
        "stance",
        "controller",
        *CONTROLLER_OPTIONS,
    ),
    PLANT_FMU: CONTROLLER_OPTIONS,
    CONTROLLER_FMU: ("terrain",),
    PACKAGE: ("terrain", "integers"),
}


@dataclass(frozen=True, kw_only=True)
class ControllerOptions:
    """The options of a controller, as given on the command line."""

    control: str
    gait: str | Gait | None
    gains: Path | None
    period: float  # s


def export(
    context: typer.Context,
    output: OutputFile = None,
    robot: RobotName = "athena",
    fmi: FmiVersion = 2,
    platforms: Platforms = None,
    integers: Integers = False,
    urdf: Urdf = False,
    mjcf: Mjcf = False,
    ssp: Ssp = False,
    values: Values = None,
    terrain: Terrains = None,
    controller: ControllerName = None,
    gait: GaitName = None,
    stance: StanceName = OWN,
    gains: GainsFile = None,
    period: Period = DEFAULT_PERIOD,
    json: Json = False,
) -> None:
    """Pack the plant FMU of a robot, or its controller's, or both as a package, or write the
    robot for other tools.
    """
    form, loaded = chosen_format(output, urdf=urdf, mjcf=mjcf), load_robot(robot)
    package = chosen_package(output, wanted=ssp, described=form is not None, values=values)
    control = DEFAULT_CONTROL if package and controller is None else controller
    chosen = None if platforms is None else [name.strip() for name in platforms.split(",")]
    _refuse_unused_options(context, _written(form, package=package, control=control))
    loaded, walked = _in_stance(loaded, stance)
    if form is not None:
        path = _export_description(loaded, output, form)
    elif control is None:
        path = _export_plant(
            loaded,
            output,
            fmi=fmi,
            platforms=chosen,
            terrains=surfaces_from(terrain or []),
            integers=integers,
        )
    else:
        options = ControllerOptions(
            control=control, gait=gait or walked, gains=gains, period=period
        )
        if package:
            path = _export_package(
                loaded, output, options, fmi=fmi, values=values or [], platforms=chosen
            )
        else:
            path = _export_controller(
                loaded, output, options, fmi=fmi, platforms=chosen, integers=integers
            )
    kind = form.name if form is not None else "ssp" if package else "fmu"
    _show_written(path, loaded, kind, json=json)


def _written(form: Format | None, *, package: bool, control: str | None) -> str:
    """Returns what is written, a key of UNUSED_OPTIONS."""
    if form is not None:
        return DESCRIPTION
    if package:
        return PACKAGE
    return PLANT_FMU if control is None else CONTROLLER_FMU


def _in_stance(robot: Robot, stance: str) -> tuple[Robot, Gait | None]:
    """Returns the robot in a stance, and the gait that belongs to it; None: the robot file's.

    Raises HexapodError for an unknown stance.
    """
    if stance not in (OWN, CHOSEN):
        raise unknown_name("stance", stance, (OWN, CHOSEN))
    if stance == OWN:
        return robot, None
    with waiting("choosing the stance"):
        walk = chosen_walk(robot)
    return walk.robot, walk.gait


def _export_description(robot: Robot, output: Path | None, form: Format) -> Path:
    """Writes a robot's URDF or MJCF file and returns its path."""
    path = export_description(robot, output or Path(f"{robot.name}{form.suffix}"), form)
    lost = left_out(robot.servo, form)
    if lost:
        warn(
            f"{path.name}: {form.title} cannot say and leaves out of the servos: {', '.join(lost)}"
        )
    return path


def _export_plant(
    robot: Robot,
    output: Path | None,
    *,
    fmi: int,
    platforms: list[str] | None,
    terrains: list[Surface],
    integers: bool,
) -> Path:
    """Writes the plant's FMU and returns its path."""
    path = _fmu_path(output, robot.name)
    with waiting("compiling" if platforms else None):
        return export_fmu(
            robot, path, fmi=fmi, platforms=platforms, terrains=terrains, integers=integers
        )


def _export_controller(
    robot: Robot,
    output: Path | None,
    options: ControllerOptions,
    *,
    fmi: int,
    platforms: list[str] | None,
    integers: bool,
) -> Path:
    """Writes the controller's FMU and returns its path."""
    path = _fmu_path(output, f"{robot.name}_controller")
    setup = _controller_setup(robot, options)
    with waiting("compiling" if platforms else None):
        return export_controller(setup, path, fmi=fmi, platforms=platforms, integers=integers)


def _export_package(
    robot: Robot,
    output: Path | None,
    options: ControllerOptions,
    *,
    fmi: int,
    values: list[str],
    platforms: list[str] | None,
) -> Path:
    """Writes plant and controller as an SSP package and returns its path."""
    path = package_path(output, robot.name)
    setup = _controller_setup(robot, options)
    with waiting("compiling" if platforms else None):
        return export_package(setup, path, values=read_values(values), platforms=platforms, fmi=fmi)


def _refuse_unused_options(context: typer.Context, written: str) -> None:
    """Raises HexapodError for options on the command line that have no effect on what is
    written.
    """
    fix = "leave them out"
    if written == PLANT_FMU:
        fix += ", or add --controller kinematic or compliant"
    names = {name: f"--{name}" for name in UNUSED_OPTIONS[written]}
    refuse_unused(context, names, written=written, fix=fix)


def _fmu_path(output: Path | None, name: str) -> Path:
    """Returns the path of the FMU to write. Raises HexapodError for a folder or another suffix."""
    path = output or Path(f"{name}.fmu")
    if path.is_dir():
        raise HexapodError(
            "not an FMU's name",
            got=str(path),
            expected="a file, not a folder",
            fix=f"write -o {path / name}.fmu",
        )
    if path.suffix != ".fmu":
        raise HexapodError(
            "not an FMU's name",
            got=path.name,
            expected="a name that ends in .fmu",
            fix=f"write -o {path.with_suffix('.fmu')}",
        )
    return path


def _controller_setup(robot: Robot, options: ControllerOptions) -> ControllerSetup:
    """Builds the controller's setup; shows a warning for gains of another robot or period."""
    gains = given_gains(options.gains)
    designs = options.control != "kinematic" and gains is None
    with waiting("designing the gains" if designs else None):
        setup = make_setup(
            robot, control=options.control, period=options.period, gait=options.gait, gains=gains
        )
    for warning in setup.build().warnings:
        warn(warning)
    return setup


def _show_written(path: Path, robot: Robot, kind: str, *, json: bool) -> None:
    """Prints the path of the file, and what was assumed when the robot was read from a URDF."""
    if json:
        show_json({kind: str(path), "robot": robot.name, "hash": robot.hash})
        return
    show_files([path])
    for key, text in robot.source.items():
        if key.startswith("URDF, "):
            print(text)
