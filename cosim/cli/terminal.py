"""Output of commands: progress bars and tables on a terminal, plain lines elsewhere, or JSON."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import typer

GAP = 2  # between columns, in characters
WIDEST = 1000  # of a table elsewhere than on a terminal
EVERY = 30.0  # s    between two lines of progress in a log

Show = Callable[[float, str], None]  # amount done, text behind the bar
Count = Callable[..., None]  # number of runs done, number of failed ones

STDOUT, STDERR = 1, 2  # descriptors

_redirections: list[ExitStack] = []  # of the running command


def refuse_unused(
    context: typer.Context, names: Mapping[str, str], *, written: str, fix: str
) -> None:
    """Raises HexapodError for words of the command line that have no effect on what is written.

    names: what the user writes, by the name of the parameter.
    """
    from hexapod_cosim.models.errors import HexapodError

    sources = {name: context.get_parameter_source(name) for name in names}
    given = [names[name] for name, one in sources.items() if one and one.name == "COMMANDLINE"]
    if given:
        raise HexapodError(
            f"options that do nothing for {written}",
            got=" ".join(given),
            expected="none of them",
            fix=fix,
        )


def show_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Prints JSON on standard output; NaN becomes null."""
    from hexapod_cosim.cosim.common.files import to_json

    restore_output()
    print(to_json(content), flush=True)


def show_files(files: Iterable[Path]) -> None:
    """Prints which files were written, one line per folder."""
    folders: dict[Path, list[str]] = {}
    for file in files:
        folders.setdefault(file.parent, []).append(file.name)
    for folder, names in folders.items():
        shown = names[0] if len(names) == 1 else "{" + ", ".join(sorted(names)) + "}"
        show_text(f"wrote {folder}/{shown}")


def show_text(text: str) -> None:
    """Prints sentences."""
    print(text, flush=True)  # a program may wait for the line


def show_table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()
) -> None:
    """Prints an aligned table, whose cells are wrapped on a terminal that is too narrow.

    right: the indices of right-aligned columns.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="")
    for k, name in enumerate(columns):
        table.add_column(name, justify="right" if k in right else "left", overflow="fold")
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else WIDEST
    plain: dict[str, Any] = {"markup": False, "highlight": False, "color_system": None}
    Console(file=sys.stdout, width=width, **plain).print(table)


def warn(text: str) -> None:
    """Prints a warning on stderr."""
    print(f"warning: {text}", file=sys.stderr)


@contextmanager
def waiting(label: str | None) -> Iterator[None]:
    """Shows a label on a terminal while the block runs."""
    if label is None or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(label):
        yield


@contextmanager
def _bar(label: str, total: float) -> Iterator[Show]:
    """Shows a progress bar on the terminal, on one line."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as TimeLeft

    columns = (TextColumn("{task.description:<12}"), BarColumn(), TextColumn("{task.fields[text]}"))
    with Progress(*columns, TimeElapsedColumn(), TimeLeft(), console=Console(stderr=True)) as bar:
        task = bar.add_task(label, total=total, text="")
        yield lambda done, text: bar.update(task, completed=done, text=text)


@contextmanager
def _log_lines(label: str) -> Iterator[Show]:
    """Prints progress as lines for a log, one every EVERY seconds at most."""
    printed = monotonic()

    def show(_done: float, text: str) -> None:
        nonlocal printed
        if monotonic() - printed >= EVERY:
            printed = monotonic()
            print(f"{label}: {text}", file=sys.stderr, flush=True)

    yield show


@contextmanager
def progress_bar(label: str, duration: float) -> Iterator[Callable[[float], None] | None]:
    """Shows a progress bar over `duration` [s] on a terminal; yields None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    with _bar(label, duration) as show:
        yield lambda time: show(time, f"{time:.1f} of {duration:g} s")


@contextmanager
def counting_bar(label: str, total: int, *, plain: bool = False) -> Iterator[Count]:
    """Shows a progress bar over a number of runs.

    Without a terminal it prints nothing, or a line now and then if `plain`.
    """
    on_terminal = sys.stderr.isatty()
    if not on_terminal and not plain:
        yield lambda done, failed=0: None
        return
    with _bar(label, total) if on_terminal else _log_lines(label) as show:

        def report(done: int, failed: int = 0) -> None:
            lost = f", {failed} failed" if failed else ""
            show(done, f"{done} of {total} runs{lost}")

        yield report


@contextmanager
def json_alone(*, wanted: bool) -> Iterator[None]:
    """Sends standard output of the block to stderr until `restore_output` is called, if wanted."""
    if not wanted:
        yield
        return
    with ExitStack() as kept:
        kept.enter_context(_printed_on_stderr())
        _redirections.append(kept)
        try:
            yield
        finally:
            _redirections.remove(kept)


def restore_output() -> None:
    """Ends the redirection of the running command, so that its JSON can be printed."""
    for kept in reversed(_redirections):
        kept.close()


@contextmanager
def _printed_on_stderr() -> Iterator[None]:
    """Sends standard output to stderr: Python's, that of C code and that of new processes."""
    sys.stdout.flush()
    kept = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, STDOUT)
        os.close(kept)
