"""What people see: progress and tables on a terminal, plain lines elsewhere, JSON for machines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from hexapod_cosim.cosim import master
from hexapod_cosim.cosim.files import to_json

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]


def is_given(context: typer.Context, name: str) -> bool:
    """Whether an option was typed rather than left at its default."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def show_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Prints JSON; NaN becomes null."""
    print(to_json(content))


def show_files(files: Iterable[Path]) -> None:
    """Says what was written, a folder's many files in one line."""
    folders: dict[Path, list[str]] = {}
    for file in files:
        folders.setdefault(file.parent, []).append(file.name)
    for folder, names in folders.items():
        print(f"wrote {folder}/" + (names[0] if len(names) == 1 else "{" + ", ".join(sorted(names)) + "}"))


def show_table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()) -> None:
    """Prints an aligned table; `right` are the columns of numbers."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(name, justify="right" if k in right else "left", no_wrap=k < len(columns) - 1)
    for row in rows:
        table.add_row(*map(Text, row))
    width = None if sys.stdout.isatty() else 160
    Console(width=width, highlight=False).print(table)


def warn(text: str) -> None:
    """A doubt, on stderr."""
    print(f"warning: {text}", file=sys.stderr)


@contextmanager
def waiting(label: str | None) -> Iterator[None]:
    """Says what takes a while, as long as it does, on a terminal."""
    if label is None or not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(label):
        yield


class _Speed(ProgressColumn):
    """Simulated over wall time."""

    def render(self, task: Task) -> Text:
        speed = task.completed / task.elapsed if task.elapsed else 0.0
        return Text(f"{task.completed:5.1f} s  {speed:4.0f} x real time")


@contextmanager
def progress_bar(label: str, duration: float) -> Iterator[master.Progress | None]:
    """A progress bar over `duration` [s] on a terminal; None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    columns = (TextColumn("{task.description:<12}"), BarColumn(), _Speed(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(label, total=duration)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def counting_bar(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar over a number of runs, told how many are done; silent where there is no terminal."""
    if not sys.stderr.isatty():
        yield lambda _done: None
        return
    columns = (TextColumn("{task.description:<12}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.update(task, completed=done)
