"""Output of commands: progress bars and tables on a terminal, plain lines elsewhere, or JSON."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column, Table
from rich.text import Text

from hexapod_cosim.cosim.cli.json_output import restore_output
from hexapod_cosim.cosim.cli.width import columns_of, fitted
from hexapod_cosim.cosim.common.files import to_json
from hexapod_cosim.cosim.master import loop as master
from hexapod_cosim.models import HexapodError

PIPE = 160  # width of tables where there is no terminal, in characters
GAP = 2  # between columns, in characters
NARROWEST = 20  # width of a column of text that is broken into lines, in characters
EVERY = 30.0  # s    between two lines of progress in a log

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]


def is_given(context: typer.Context, name: str) -> bool:
    """Returns whether an option was given on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def refuse_unused(
    context: typer.Context, names: Mapping[str, str], *, written: str, fix: str
) -> None:
    """Raises HexapodError for words of the command line that have no effect on what is written.

    names: what the user writes, by the name of the parameter.
    """
    given = [word for name, word in names.items() if is_given(context, name)]
    if given:
        raise HexapodError(
            f"options that do nothing for {written}",
            got=" ".join(given),
            expected="none of them",
            fix=fix,
        )


def show_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Prints JSON on standard output; NaN becomes null."""
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
    """Prints sentences, wrapped between words on a terminal."""
    print(fitted(text, sys.stdout), flush=True)  # a program may wait for the line


def show_table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()
) -> None:
    """Prints an aligned table; `right` are the indices of right-aligned columns.

    On a terminal that is too narrow, the last column is wrapped if it is text, or the gaps between
    columns shrink, or the remaining columns follow in another table below the first column.
    """
    texts, width = [list(row) for row in rows], columns_of(sys.stdout)
    widths = [max(map(len, column)) for column in zip(columns, *texts, strict=True)]
    gap, blocks = _layout(widths, width or PIPE, broken=len(columns) - 1 not in right)
    console = Console(width=width or PIPE, force_terminal=width is not None, highlight=False)
    for number, block in enumerate(blocks):
        if number:
            print()
        table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
        for k in block:
            last = k == len(columns) - 1
            table.add_column(
                columns[k],
                justify="right" if k in right else "left",
                no_wrap=not last,
                overflow="fold",
            )
        for row in texts:
            table.add_row(*(Text(row[k]) for k in block))
        console.print(table)


def _layout(widths: Sequence[int], width: int, *, broken: bool) -> tuple[int, list[list[int]]]:
    """Returns the gap between columns and the columns of each table, for a terminal's width.

    broken: whether the last column may be wrapped.
    """
    whole = list(range(len(widths)))
    least = [*widths[:-1], min(widths[-1], NARROWEST)] if broken else widths
    for gap in (GAP, 1):
        if sum(least) + gap * (len(least) - 1) <= width:
            return gap, [whole]
    blocks = [[0]]
    for k in whole[1:]:
        used = sum(least[place] + GAP for place in blocks[-1])
        if len(blocks[-1]) > 1 and used + least[k] > width:
            blocks.append([0])
        blocks[-1].append(k)
    return GAP, blocks


def warn(text: str) -> None:
    """Prints a warning on stderr."""
    print(fitted(f"warning: {text}", sys.stderr), file=sys.stderr)


@contextmanager
def waiting(label: str | None) -> Iterator[None]:
    """Shows a label on a terminal while the block runs."""
    if label is None or not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(label):
        yield


class _Simulated(ProgressColumn):
    """Simulated time and its ratio to wall time since the first step."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.completed:5.1f} of {task.total:g} s  {_rate(task):4.0f} x real time")


class _Counted(ProgressColumn):
    """Number of completed runs, runs per minute since the count began, and failed runs.

    The task's field `already` is the number of runs before the count began.
    """

    def render(self, task: Task) -> Text:
        rate = f"{60.0 * _rate(task):4.0f} a minute" if _rate(task) else ""
        failed = f"  {task.fields['failed']} failed" if task.fields.get("failed") else ""
        return Text(f"{task.completed:.0f} of {task.total:.0f} runs  {rate}{failed}")


class _Left(ProgressColumn):
    """Estimated remaining time; at the end, the time taken."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        if task.finished and task.finished_time is not None:
            return Text(f"in {_clock(task.finished_time)}")
        rate = _rate(task)
        return Text(f"{_clock((task.remaining or 0.0) / rate)} left" if rate else "")


def _rate(task: Task) -> float:
    """Progress per second since the task was started; 0 while that is unknown."""
    elapsed = task.finished_time or task.elapsed
    return (task.completed - float(task.fields["already"])) / elapsed if elapsed else 0.0


def _clock(seconds: float) -> str:
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _whole() -> Column:
    """Returns a column of a progress bar that is never wrapped: the bar shrinks instead."""
    return Column(no_wrap=True)


@contextmanager
def _bar(label: str, total: float, shown: ProgressColumn) -> Iterator[Callable[..., None]]:
    """Shows a progress bar that pulses until the first report of progress and counts from there."""
    columns = (TextColumn("{task.description:<12}"), BarColumn(), shown, _Left(_whole()))
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(label, total=total, start=False, already=0.0)

        def report(done: float, failed: int = 0) -> None:
            if bar.tasks[0].start_time is None:
                bar.start_task(task)
                bar.update(task, already=done)
            bar.update(task, completed=done, failed=failed)

        yield report


@contextmanager
def progress_bar(label: str, duration: float) -> Iterator[master.Progress | None]:
    """Shows a progress bar over `duration` [s] on a terminal; yields None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    with _bar(label, duration, _Simulated(_whole())) as report:
        yield report


@contextmanager
def steps(*, shown: bool = True) -> Iterator[Callable[[str], None]]:
    """Yields a function that shows what is being done on stderr: a status on a terminal, a line
    elsewhere, nothing unless `shown`.
    """
    if shown and sys.stderr.isatty():
        with Console(stderr=True).status("") as status:
            yield status.update
    else:
        yield lambda text: print(text, file=sys.stderr, flush=True) if shown else None


class Count(Protocol):
    """Reports how many runs are done, and how many failed since the first report."""

    def __call__(self, done: int, failed: int = 0) -> None: ...


@contextmanager
def counting_bar(label: str, total: int, *, plain: bool = False) -> Iterator[Count]:
    """Shows a progress bar over a number of runs.

    Without a terminal it prints nothing, or a line now and then if `plain`.
    """
    if not sys.stderr.isatty():
        yield _PlainCount(label, total) if plain else lambda done, failed=0: None
        return
    with _bar(label, total, _Counted(_whole())) as report:
        yield report


class _PlainCount:
    """Prints progress as lines for a log, one every EVERY seconds at most."""

    def __init__(self, label: str, total: int) -> None:
        self._label, self._total = label, total
        self._begun = self._printed = monotonic()
        self._already: int | None = None

    def __call__(self, done: int, failed: int = 0) -> None:
        now = monotonic()
        if self._already is None:
            self._already, self._begun, self._printed = done, now, now
        elif now - self._printed >= EVERY:
            self._printed = now
            rate = (done - self._already) / (now - self._begun)
            left = f", {_clock((self._total - done) / rate)} left" if rate else ""
            counted = f"{done} of {self._total}, {60.0 * rate:.0f} a minute"
            print(
                f"{self._label}: {counted}{left}, {failed} failed",
                file=sys.stderr,
                flush=True,
            )
