"""The `hexapod` application with all its commands."""

from __future__ import annotations

from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import (
    benchmark_command,
    compare_command,
    controller_command,
    examples_command,
    export_command,
    fmu_commands,
    identify_command,
    listing,
    replay_command,
    run_commands,
    terrain_command,
)
from hexapod_cosim.cosim.cli.failures import EPILOG
from hexapod_cosim.cosim.cli.live import live_command
from hexapod_cosim.cosim.cli.study import study_command
from hexapod_cosim.cosim.common.plant_files import package_version

app = typer.Typer(
    name="hexapod",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog=EPILOG,
)
app.command("export")(export_command.export)
app.command("simulate", epilog=run_commands.EPILOG)(run_commands.simulate)
app.command("compare", epilog=compare_command.EPILOG)(compare_command.compare)
app.command("study", epilog=study_command.EPILOG)(study_command.study)
app.command("benchmark", epilog=benchmark_command.EPILOG)(benchmark_command.benchmark)
app.command("design")(fmu_commands.design)
app.command("report")(run_commands.report)
app.add_typer(controller_command.app, name="controller")
app.command("examples")(examples_command.examples)
app.command("validate")(fmu_commands.validate)
app.command("terrain")(terrain_command.terrain)
app.command("live")(live_command.live)
app.command("replay")(replay_command.replay)
app.command("identify")(identify_command.identify)
app.command("list")(listing.list_what)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(package_version())
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Print the version and stop."
        ),
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show where an unexpected error arose.")
    ] = False,
) -> None:
    """A walking hexapod as an FMU, its compliant control, and their co-simulation."""
