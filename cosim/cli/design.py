"""Defines the command `hexapod design`."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.cli.options import Json, RobotName

if TYPE_CHECKING:
    from hexapod_cosim.controller import Gains

MacroStep = Annotated[
    float, typer.Option("--period", "--macro-step", help="Period of the controller [s].")
]
RequirementSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="REQUIREMENT=VALUE", help="Ask for something else (phase_margin=50)."
    ),
]
DesignFolder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/design."),
]


def design(
    robot: RobotName = "athena",
    macro_step: MacroStep = DEFAULT_PERIOD,
    settings: RequirementSettings = None,
    output: DesignFolder = None,
    json: Json = False,
) -> None:
    """Design the gains of compliant and paper control, with plots."""
    from hexapod_cosim.controller import save_gains
    from hexapod_cosim.controller.design import design_gains, plot_design
    from hexapod_cosim.cosim.cli.terminal import show_files, show_json
    from hexapod_cosim.cosim.common.files import writing_into
    from hexapod_cosim.cosim.design.gains import examine_stances, read_requirements
    from hexapod_cosim.models import load_robot

    loaded, folder = load_robot(robot), output or Path("out") / "design"
    requirements = read_requirements(settings or [], loaded)
    plants, left_out = examine_stances(loaded, macro_step)
    gains = design_gains(
        loaded, macro_step, plants=plants, requirements=requirements, left_out=left_out
    )
    with writing_into(folder):
        files = [save_gains(gains, folder / "gains.toml")]
        files += plot_design(loaded, gains, plants, folder)
    if json:
        names = [str(file) for file in files]
        show_json({"gains": asdict(gains), "files": names})
        return
    _show_design(gains)
    show_files(files)


def _show_design(gains: Gains) -> None:
    """Prints requirements and margins."""
    from hexapod_cosim.cosim.cli.terminal import show_table, show_text

    show_table(["requirement", "asked", "reached"], _design_rows(gains), right=(1, 2))
    show_text(f"binding: {gains.margins.binding}")
    for text in gains.caveats:
        show_text(text)


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
