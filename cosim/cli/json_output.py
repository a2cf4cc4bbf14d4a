"""Keeps standard output for the JSON of a command with --json.

What a user's law, C code or a worker process prints until then goes to stderr.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout

STDOUT, STDERR = 1, 2  # descriptors

_redirections: list[ExitStack] = []  # of the running command


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
