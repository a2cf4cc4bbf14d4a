"""The `hexapod` application with all its commands."""

from __future__ import annotations

from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import (
    compare_command,
    controller_command,
    examples_command,
    export_command,
    fmu_commands,
    listing,
    run_commands,
    terrain_command,
)
from hexapod_cosim.cosim.cli.extension import installed_extensions
from hexapod_cosim.cosim.cli.failures import EPILOG
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
app.command("design")(fmu_commands.design)
app.command("report")(run_commands.report)
app.add_typer(controller_command.app, name="controller")
app.command("examples")(examples_command.examples)
app.command("validate")(fmu_commands.validate)
app.command("terrain")(terrain_command.terrain)
app.command("list")(listing.list_what)
for extension in installed_extensions():
    for command in extension.commands:
        if isinstance(command.run, typer.Typer):
            app.add_typer(command.run, name=command.name, epilog=command.epilog)
        else:
            app.command(command.name, epilog=command.epilog)(command.run)


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
