"""The `hexapod` application with all its commands, which are imported when they are called."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from hexapod_cosim.cosim.cli.extension import Command, installed_extensions, loaded
from hexapod_cosim.cosim.cli.failures import EPILOG

CLI = "hexapod_cosim.cosim.cli"
# name, line in the list of commands, place in cosim/cli
CORE = (
    ("export", "Write the FMU of a robot, its controller, or a package.", "export:export"),
    ("simulate", "Run one co-simulation: results, metrics, plots.", "simulate:simulate"),
    ("compare", "Run walks under several controls and report them.", "compare:compare"),
    ("design", "Design the gains of compliant and paper control.", "design:design"),
    ("report", "Make the plots and the report of a folder again.", "report:report"),
    ("controller", "Write a controller of your own.", "examples:app"),
    ("examples", "Copy the example programs and notebooks.", "examples:examples"),
    ("validate", "Check an FMU of ours and say what is wrong.", "export:validate"),
    ("terrain", "Show a surface to walk on.", "catalogue:terrain"),
    ("list", "List robots, scenarios, gaits, terrains and others.", "catalogue:list_what"),
)


class LazyGroup(TyperGroup):
    """A group that imports a command when it is called, and not to list the names of all."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._entries = {entry.name: entry for entry in all_commands()}
        self.commands = {
            name: TyperCommand(name, help=entry.about) for name, entry in self._entries.items()
        }
        self._lists_names = False

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Returns a command, or only its name and help while names are listed."""
        if self._lists_names or cmd_name not in self._entries:
            return self.commands.get(cmd_name)
        return _typer_command(self._entries[cmd_name])

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes the list of commands."""
        self._lists_names = True
        super().format_commands(ctx, formatter)
        self._lists_names = False

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Returns the completions of a command's name."""
        self._lists_names = True
        found = super().shell_complete(ctx, incomplete)
        self._lists_names = False
        return found


def all_commands() -> list[Command]:
    """Returns the commands of the core and of the installed extensions."""
    core = [Command(name=name, about=text, place=f"{CLI}.{place}") for name, text, place in CORE]
    return [*core, *(one for extension in installed_extensions() for one in extension.commands)]


def _typer_command(entry: Command) -> Any:
    """Imports a command and returns it as the parser's."""
    run = loaded(entry.place)
    if isinstance(run, typer.Typer):
        group = get_command(run)
        group.name = entry.name
        return group
    epilog = getattr(import_module(entry.place.partition(":")[0]), "EPILOG", None)
    alone = typer.Typer(rich_markup_mode=None, add_completion=False)
    alone.command(entry.name, epilog=epilog)(run)
    return get_command(alone)


app = typer.Typer(
    name="hexapod",
    cls=LazyGroup,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog=EPILOG,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from hexapod_cosim.cosim.common.plant_files import package_version

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
