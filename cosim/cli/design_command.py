"""Defines the command `hexapod design`."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.options import Json, RobotName

if TYPE_CHECKING:
    from hexapod_cosim.controller import Gains
    from hexapod_cosim.cosim.design.stance import StanceDesign

MacroStep = Annotated[
    float, typer.Option("--period", "--macro-step", help="Period of the controller [s].")
]
RequirementSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="REQUIREMENT=VALUE",
        help="Ask for something else (phase_margin=50).",
        autocompletion=completion.requirement,
    ),
]
DesignFolder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/design."),
]
StanceFlag = Annotated[
    bool,
    typer.Option("--stance", help="Find the stance of least heat first, and write its robot file."),
]


def design(
    robot: RobotName = "athena",
    macro_step: MacroStep = DEFAULT_PERIOD,
    settings: RequirementSettings = None,
    stance: StanceFlag = False,
    output: DesignFolder = None,
    json: Json = False,
) -> None:
    """Design the gains of compliant and paper control, with plots."""
    from hexapod_cosim.controller import save_gains
    from hexapod_cosim.controller.design import design_gains, plot_design
    from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table
    from hexapod_cosim.cosim.common.files import writing_into
    from hexapod_cosim.cosim.design.gains import examine_stances, read_requirements
    from hexapod_cosim.cosim.design.verification import check_design
    from hexapod_cosim.models import load_robot

    loaded, folder, files = load_robot(robot), output or Path("out") / "design", list[Path]()
    found = None
    if stance:
        found, file = _find_stance(robot, folder)
        files, loaded = [file], found.robot
    requirements = read_requirements(settings or [], loaded)
    plants, left_out = examine_stances(loaded, macro_step)
    gains = design_gains(
        loaded, macro_step, plants=plants, requirements=requirements, left_out=left_out
    )
    deviation = check_design(loaded, gains).error
    with writing_into(folder):
        files += [save_gains(gains, folder / "gains.toml")]
        files += plot_design(loaded, gains, plants, folder)
    if json:
        names = [str(file) for file in files]
        content = {"gains": asdict(gains), "check_error": deviation, "files": names}
        show_json(content if found is None else content | {"stance": _stance_json(found)})
        return
    if found is not None:
        show_table(["stance", "before", "after"], _stance_rows(found), right=(1, 2))
    _show_design(gains, deviation)
    show_files(files)


def _find_stance(robot: str, folder: Path) -> tuple[StanceDesign, Path]:
    """Finds the stance of least heat of a robot and writes NAME_stance.toml into a folder.

    The robot of the result is that of the written file. Raises GainsError.
    """
    from hexapod_cosim.cosim.common.files import writing_into
    from hexapod_cosim.cosim.design.stance import find_stance, write_robot
    from hexapod_cosim.models import load_robot
    from hexapod_cosim.models.robot import robot_path

    loaded = load_robot(robot)
    found, name = find_stance(loaded), f"{loaded.name}_stance"
    with writing_into(folder):
        file = write_robot(robot_path(robot), found.robot, folder / f"{name}.toml", name=name)
    return replace(found, robot=load_robot(file)), file


def _stance_rows(found: StanceDesign) -> list[tuple[str, str, str]]:
    """Returns the rows of the table of a stance: name, value of the robot's own, value found."""
    before, after = found.before, found.after
    rows = (
        ("feet further out [mm]", 0.0, 1e3 * found.outward),
        ("torso higher [mm]", 0.0, 1e3 * found.deeper),
        ("heat, sum of squared torques [N2 m2]", before.heat, after.heat),
        ("hottest servo, RMS [N m]", before.hottest, after.hottest),
        ("distance from tipping, over the height [1]", before.firmness, after.firmness),
        ("fastest joint [rad/s]", before.speed, after.speed),
    )
    return [(name, f"{first:.4g}", f"{second:.4g}") for name, first, second in rows]


def _stance_json(found: StanceDesign) -> dict[str, Any]:
    """Returns what --json prints of a stance."""
    return {
        "outward": found.outward,
        "deeper": found.deeper,
        "before": asdict(found.before),
        "after": asdict(found.after),
    }


def _show_design(gains: Gains, deviation: float) -> None:
    """Prints requirements and margins; deviation: of the FMU from the linear loop, relative."""
    from hexapod_cosim.cosim.cli.terminal import show_table, show_text

    show_table(["requirement", "asked", "reached"], _design_rows(gains), right=(1, 2))
    show_text(f"binding: {gains.margins.binding}")
    for text in gains.caveats:
        show_text(text)
    show_text(
        "a small spread of the feet in the non-linear FMU goes as the linear loop predicts, "
        f"to {100.0 * deviation:.2g} % of its peak"
    )


def _design_rows(gains: Gains) -> list[tuple[str, str, str]]:
    """Returns the rows of the table of requirements: name, required value, reached value."""
    needs, reached, paper = gains.requirements, gains.margins, gains.paper
    rows = (
        ("phase margin, paper [deg]", f">= {needs.phase_margin:g}", reached.paper_phase_margin),
        ("gain margin, paper [dB]", f">= {needs.gain_margin:g}", reached.paper_gain_margin),
        (
            "static gain margin, paper [dB]",
            f">= {needs.static_margin:g}",
            reached.paper_static_margin,
        ),
        ("spectral radius, paper, all feet [1]", "< 1", reached.paper_spectral_radius),
        ("share taken back, along the ground [1]", f"<= {needs.share:g}", paper.share),
        ("share taken back, upwards [1]", f"<= {needs.height_share:g}", paper.height_share),
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
