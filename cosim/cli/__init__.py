"""The `hexapod` command: parse, call one function, exit code. 0 only on success; an error is one paragraph on stderr."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import fmu_commands, listing, run_commands
from hexapod_cosim.cosim.plant_files import package_version
from hexapod_cosim.models import HexapodError

FAILURE, INTERRUPT = 1, 130

app = typer.Typer(name="hexapod", no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False)
app.command("export")(fmu_commands.export)
app.command("simulate")(run_commands.simulate)
app.command("compare")(run_commands.compare)
app.command("design")(fmu_commands.design)
app.command("report")(run_commands.report)
app.command("validate")(fmu_commands.validate)
app.command("list")(listing.list_what)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(package_version())
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and stop.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show where an unexpected error arose.")] = False,
) -> None:
    """A walking hexapod as an FMU, its compliant control, and their co-simulation."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line. Returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(args=given, prog_name="hexapod")
    except SystemExit as stop:
        return 0 if stop.code is None else stop.code if isinstance(stop.code, int) else FAILURE
    except HexapodError as error:
        print(f"hexapod: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("hexapod: interrupted from the keyboard", file=sys.stderr)
        return INTERRUPT
    except Exception as error:
        if "--debug" in given:
            raise
        print(f"hexapod: unexpected {type(error).__name__}: {error}; run `hexapod --debug ...` to see where", file=sys.stderr)
    return FAILURE
