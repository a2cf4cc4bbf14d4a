"""`hexapod export`, `validate` and `design`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import Gains, save_gains
from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.running import GainsFile, given_gains
from hexapod_cosim.cosim.cli.terminal import (
    Json,
    is_given,
    show_files,
    show_json,
    show_table,
    show_text,
    waiting,
    warn,
)
from hexapod_cosim.cosim.common.files import not_writable
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.export.robot_files import chosen_format, export_description
from hexapod_cosim.cosim.export.robot_package import SUFFIX as PACKAGE_SUFFIX
from hexapod_cosim.cosim.export.robot_package import (
    chosen_package,
    export_package,
    package_path,
    read_values,
)
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.cosim.validate.validation import find_problems
from hexapod_cosim.models import FmuError, HexapodError, Robot, load_robot

RobotName = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="A robot file, a URDF, or a name of `hexapod list robots`.",
        autocompletion=completion.robot,
    ),
]
DEFAULT_PERIOD = 0.005  # s, the default macro-step
OF_CONTROLLER = ("gait", "gains", "period")
DESCRIPTION, PLANT_FMU = "a robot's description", "the plant's FMU"
IDLE = {
    DESCRIPTION: ("fmi", "platforms", "controller", *OF_CONTROLLER),
    PLANT_FMU: OF_CONTROLLER,
}  # options that do nothing, by what is written
DEFAULT_CONTROL = "compliant"  # of a package


def export(
    context: typer.Context,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="The file to write; default ROBOT.fmu, .ssp, .urdf or .xml.",
        ),
    ] = None,
    robot: RobotName = "athena",
    fmi: Annotated[int, typer.Option("--fmi", help="Version of the standard: 2 or 3.")] = 2,
    platforms: Annotated[
        str | None,
        typer.Option(
            "--platforms",
            help="Cross-compile for these, separated by commas (linux64, win64, darwin64, aarch64-linux, or FMI 3's names of them) or all; "
            "sources: no binary. "
            "Default: this machine's installed one.",
        ),
    ] = None,
    urdf: Annotated[
        bool,
        typer.Option("--urdf", help="Write the robot as a URDF instead; so does -o FILE.urdf."),
    ] = False,
    mjcf: Annotated[
        bool,
        typer.Option("--mjcf", help="Write it as a MuJoCo model instead; so does -o FILE.xml."),
    ] = False,
    ssp: Annotated[
        bool,
        typer.Option(
            "--ssp",
            help="Write plant and controller, connected and walking, as a package (SSP); so does -o FILE.ssp.",
        ),
    ] = False,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Of the package: controller.command.vx=0.05, plant.friction.mu=0.5, ...",
        ),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller",
            metavar="|".join(CONTROLS),
            help="Pack the robot's controller instead of the plant.",
            autocompletion=completion.control,
        ),
    ] = None,
    gait: Annotated[
        str | None,
        typer.Option(
            "--gait",
            help="Of the controller: one of `hexapod list gaits`.",
            autocompletion=completion.gait,
        ),
    ] = None,
    gains: GainsFile = None,
    period: Annotated[
        float, typer.Option("--period", help="Of the controller [s].")
    ] = DEFAULT_PERIOD,
    json: Json = False,
) -> None:
    """Pack the plant FMU of a robot, or its controller's, or both as a package, or write the
    robot for other tools.
    """
    form, made = chosen_format(output, urdf=urdf, mjcf=mjcf), load_robot(robot)
    package = chosen_package(output, wanted=ssp, described=form is not None, values=values, fmi=fmi)
    controller = DEFAULT_CONTROL if package and controller is None else controller
    _refuse_idle(
        context, DESCRIPTION if form is not None else PLANT_FMU if controller is None else None
    )
    if form is not None:
        written = export_description(made, output or Path(f"{made.name}{form.suffix}"), form)
        _show_written(written, made, form.name, json=json)
        return
    path = (
        package_path(output, made.name)
        if package
        else _fmu_path(output, made.name if controller is None else f"{made.name}_controller")
    )
    chosen = None if platforms is None else [name.strip() for name in platforms.split(",")]
    setup = None if controller is None else _controller_setup(made, controller, gait, gains, period)
    with waiting("compiling" if chosen else None):
        if setup is not None and package:
            export_package(setup, path, values=read_values(values or []), platforms=chosen)
        elif setup is None:
            export_fmu(made, path, fmi=fmi, platforms=chosen)
        else:
            export_controller(setup, path, fmi=fmi, platforms=chosen)
    _show_written(path, made, "ssp" if package else "fmu", json=json)


def _refuse_idle(context: typer.Context, written: str | None) -> None:
    """Raises HexapodError for options that were typed, by name, and have no effect on what is
    written.
    """
    given = [f"--{name}" for name in IDLE.get(written or "", ()) if is_given(context, name)]
    if given:
        fix = (
            "leave them out"
            if written == DESCRIPTION
            else "leave them out, or add --controller kinematic or compliant"
        )
        raise HexapodError(
            f"options that do nothing for {written}",
            got=" ".join(given),
            expected="none of them",
            fix=fix,
        )


def _fmu_path(output: Path | None, name: str) -> Path:
    """Where an FMU goes. Raises HexapodError for what is no FMU's name."""
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


def _controller_setup(
    robot: Robot, control: str, gait: str | None, gains: Path | None, period: float
) -> ControllerSetup:
    """What the controller is made of; gains of another robot or period are warned about."""
    given = given_gains(gains)
    with waiting("designing the gains" if control == "compliant" and given is None else None):
        setup = make_setup(robot, control=control, period=period, gait=gait, gains=given)
    for warning in setup.build().warnings:
        warn(warning)
    return setup


def _show_written(path: Path, robot: Robot, kind: str, *, json: bool) -> None:
    if json:
        show_json({kind: str(path), "robot": robot.name, "hash": robot.hash})
        return
    show_files([path])
    print(
        "".join(f"{text}\n" for key, text in robot.source.items() if key.startswith("URDF, ")),
        end="",
    )


class UnsoundError(FmuError):
    """An FMU with problems; `found` is what --json says of it beside the error."""

    def __init__(self, fmu: Path, problems: Sequence[str], what: str, **parts: Any) -> None:
        super().__init__(what, **parts)
        self.found = {"fmu": str(fmu), "valid": False, "problems": list(problems)}


def validate(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU to check.")],
    json: Json = False,
) -> None:
    """Check an FMU of ours and say what is wrong."""
    if fmu.suffix == PACKAGE_SUFFIX:
        fix = (
            f"unpack it (`unzip {fmu.name} -d package`) and validate the FMUs in package/resources"
        )
        raise FmuError("packages are not checked here", got=fmu.name, expected="an FMU", fix=fix)
    try:
        problems = find_problems(fmu)
    except HexapodError as error:  # not even to be read
        parts = {
            "got": error.got,
            "expected": error.expected,
            "fix": error.fix,
            "where": error.where,
        }
        raise UnsoundError(fmu, [str(error)], error.what, **parts) from error
    if problems:
        if not json:
            print("\n".join(problems))
        fix = "export it again with `hexapod export`"
        what, got = "the FMU is not sound: problems", f"{len(problems)} of them"
        raise UnsoundError(fmu, problems, what, got=got, expected="none", fix=fix, where=str(fmu))
    if json:
        show_json({"fmu": str(fmu), "valid": True, "problems": []})
    else:
        print(f"{fmu}: no problems found")


def design(
    robot: RobotName = "athena",
    macro_step: Annotated[
        float, typer.Option("--period", "--macro-step", help="Period of the controller [s].")
    ] = DEFAULT_PERIOD,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="REQUIREMENT=VALUE",
            help="Ask for something else (phase_margin=50).",
            autocompletion=completion.requirement,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/design."),
    ] = None,
    json: Json = False,
) -> None:
    """Design the gains of the compliant control, with plots."""
    # slow to import: python-control, matplotlib
    from hexapod_cosim.controller.design import design_gains, plot_design  # noqa: PLC0415
    from hexapod_cosim.cosim.design.design import examine_stances, read_requirements  # noqa: PLC0415
    from hexapod_cosim.cosim.design.design_check import check_design  # noqa: PLC0415

    made, folder = load_robot(robot), output or Path("out") / "design"
    needs = read_requirements(settings or [], made)
    plants, left_out = examine_stances(made, macro_step)
    gains = design_gains(made, macro_step, plants=plants, requirements=needs, left_out=left_out)
    deviation = check_design(made, gains).error
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files = [
            save_gains(gains, folder / "gains.toml"),
            *plot_design(made, gains, plants, folder),
        ]
    except OSError as error:
        raise not_writable(folder, error) from error
    if json:
        show_json(
            {
                "gains": asdict(gains),
                "check_error": deviation,
                "files": [str(file) for file in files],
            }
        )
        return
    show_table(["requirement", "asked", "reached"], design_rows(gains), right=(1, 2))
    show_text(f"binding: {gains.margins.binding}")
    for text in gains.caveats:
        show_text(text)
    show_text(
        f"a small squeeze in the non-linear FMU goes as the linear loop predicts, to {100.0 * deviation:.2g} % of its peak"
    )
    show_files(files)


def design_rows(gains: Gains) -> list[tuple[str, str, str]]:
    """What was asked for and what was reached, as they are shown."""
    needs, reached, spring = gains.requirements, gains.margins, gains.suspension
    frequency = math.sqrt(spring.stiffness / spring.mass) / (2.0 * math.pi)
    rows = (
        ("phase margin, tangential [deg]", f">= {needs.phase_margin:g}", reached.slip_phase_margin),
        ("gain margin, tangential [dB]", f">= {needs.gain_margin:g}", reached.slip_gain_margin),
        (
            "phase margin, suspension [deg]",
            f">= {needs.phase_margin:g}",
            reached.suspension_phase_margin,
        ),
        (
            "gain margin, suspension [dB]",
            f">= {needs.gain_margin:g}",
            reached.suspension_gain_margin,
        ),
        ("frequency, suspension [Hz]", f"<= {needs.frequency:g}", frequency),
        ("spectral radius, all feet and laws [1]", "< 1", reached.spectral_radius),
        ("integral action ki [1/s]", "most", gains.slip.ki),
        ("crossover, tangential [rad/s]", f">= {needs.bandwidth:g}", reached.slip_crossover),
        ("further delay borne, tangential [s]", "", reached.slip_delay_margin),
        (
            "steady slip with the law, of that without [1]",
            f"<= {needs.slip_rejection:g}",
            reached.slip_rejection,
        ),
        (
            "torque of a standing tripod's servo [N m]",
            f"<= {gains.limits.torque:g}",
            reached.support_torque,
        ),
    )
    return [
        (name, asked, "no crossing" if math.isinf(value) else f"{value:.4g}")
        for name, asked, value in rows
    ]
