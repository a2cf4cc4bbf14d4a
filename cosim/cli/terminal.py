"""Output of commands: progress bars and tables on a terminal, plain lines elsewhere, or JSON."""

from __future__ import annotations

import math
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    import typer

GAP = 2  # between columns, in characters
NARROWEST = 20  # width of a column of text that is broken into lines, in characters
EVERY = 30.0  # s    between two lines of progress in a log

Show = Callable[[float, str], None]  # amount done, text behind the bar
Count = Callable[..., None]  # number of runs done, number of failed ones

USUAL = 80  # characters; where the width is unknown
LEAST = 20
INDENT = "  "  # of the continuation of a wrapped line

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
    """Prints sentences, wrapped between words on a terminal."""
    print(fitted(text, sys.stdout), flush=True)  # a program may wait for the line


def show_table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()
) -> None:
    """Prints an aligned table; `right` are the indices of right-aligned columns.

    On a terminal that is too narrow, the last column is wrapped if it is text, the gaps between
    columns shrink, or the remaining columns follow in another table below the first column.
    """
    lines = [list(columns), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    room, last = columns_of(sys.stdout) or sum(widths) + GAP * len(widths), len(columns) - 1
    if last not in right:  # text, which may be wrapped
        before = sum(widths[:last]) + GAP * last
        widths[last] = min(widths[last], max(room - before, NARROWEST))
    gap = 1 if sum(widths) + last <= room < sum(widths) + GAP * last else GAP
    for number, block in enumerate(_blocks(widths, room, gap)):
        if number:
            print()
        for line in lines:
            cells = [_cell(line[k], widths[k], right=k in right) for k in block]
            height = max(map(len, cells))
            for k in range(height):
                parts = [
                    cell[k] if k < len(cell) else " " * widths[column]
                    for column, cell in zip(block, cells, strict=True)
                ]
                print((" " * gap).join(parts).rstrip())


def _cell(text: str, width: int, *, right: bool) -> list[str]:
    """Returns the lines of a cell."""
    parts = textwrap.wrap(text, width) if len(text) > width else [text]
    return [part.rjust(width) if right else part.ljust(width) for part in parts]


def _blocks(widths: Sequence[int], room: int, gap: int) -> list[list[int]]:
    """Returns the columns of each table; all but the first begin with column 0."""
    blocks = [[0]]
    for k in range(1, len(widths)):
        used = sum(widths[place] + gap for place in blocks[-1])
        if len(blocks[-1]) > 1 and used + widths[k] > room:
            blocks.append([0])
        blocks[-1].append(k)
    return blocks


def warn(text: str) -> None:
    """Prints a warning on stderr."""
    print(fitted(f"warning: {text}", sys.stderr), file=sys.stderr)


@contextmanager
def waiting(label: str | None) -> Iterator[None]:
    """Shows a label on a terminal while the block runs."""
    if label is None or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(label):
        yield


class _Pace:
    """Progress per second since the first report, and the time that is left."""

    def __init__(self, total: float) -> None:
        self._total = total
        self._first: tuple[float, float] | None = None  # time [s] and amount

    def __call__(self, done: float) -> tuple[float, str]:
        """Returns the rate and a text on the time left, both unknown at first."""
        now = monotonic()
        begun, already = self._first = self._first or (now, done)
        rate = (done - already) / (now - begun) if now > begun else 0.0
        if done >= self._total:
            return rate, f"in {_clock(now - begun)}"
        return rate, f"{_clock((self._total - done) / rate)} left" if rate else ""


def _clock(seconds: float) -> str:
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


@contextmanager
def _bar(label: str, total: float) -> Iterator[Show]:
    """Shows a progress bar on the terminal, on one line."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn
    from rich.table import Column

    behind = TextColumn("{task.fields[text]}", table_column=Column(no_wrap=True))
    columns = (TextColumn("{task.description:<12}"), BarColumn(), behind)
    with Progress(*columns, console=Console(stderr=True)) as bar:
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
    pace = _Pace(duration)
    with _bar(label, duration) as show:

        def report(time: float) -> None:
            rate, left = pace(time)
            show(time, f"{time:5.1f} of {duration:g} s  {rate:4.0f} x real time  {left}")

        yield report


@contextmanager
def counting_bar(label: str, total: int, *, plain: bool = False) -> Iterator[Count]:
    """Shows a progress bar over a number of runs.

    Without a terminal it prints nothing, or a line now and then if `plain`.
    """
    on_terminal = sys.stderr.isatty()
    if not on_terminal and not plain:
        yield lambda done, failed=0: None
        return
    pace = _Pace(total)
    with _bar(label, total) if on_terminal else _log_lines(label) as show:

        def report(done: int, failed: int = 0) -> None:
            rate, left = pace(done)
            lost = [f"{failed} failed"] if failed else []
            texts = [f"{done} of {total} runs", f"{60.0 * rate:.0f} a minute", left, *lost]
            show(done, ", ".join(filter(None, texts)))

        yield report


def columns_of(stream: TextIO) -> int | None:
    """Returns the width of a stream's terminal, or None if it is none; COLUMNS overrides it."""
    if not stream.isatty():
        return None
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given):
        return max(int(given), LEAST)
    try:
        return max(os.get_terminal_size(stream.fileno()).columns, LEAST)
    except (OSError, ValueError):  # no real terminal
        return USUAL


def fitted(text: str, stream: TextIO) -> str:
    """Returns text wrapped for this stream; words, such as paths, stay whole."""
    width = columns_of(stream)
    if width is None:
        return text
    wrapped = (
        textwrap.wrap(
            line, width, subsequent_indent=INDENT, break_long_words=False, break_on_hyphens=False
        )
        for line in text.split("\n")
    )
    return "\n".join("\n".join(lines) for lines in wrapped)


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
