"""Runs pytest in forks of a process that has imported the large packages already.

usage: python -m tools.mutants.server      (in the copy; tools/mutants/worker.py starts it)

HEXAPOD_JOBS names two file descriptors, to read and to write. A line that is read is a job as JSON:
`arguments` of pytest, `env` (variables to set), `output` (the file of what it prints) and `seconds`
(the limit of wall time). The answer is a line with the exit code, or the signal with a minus sign.
The package's own modules are imported by each fork, because mutants change them.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import time
from contextlib import suppress
from typing import Any

PACKAGES = (
    *("pytest", "xdist.plugin", "xdist.scheduler", "hypothesis", "numpy", "numpy.testing", "lxml"),
    *("scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.stats", "scipy.interpolate"),
    *("control", "fmpy", "fmpy.fmi2", "fmpy.fmi3", "fmpy.validation", "matplotlib.figure"),
    *("matplotlib.backends.backend_agg", "jinja2", "typer", "rich.console", "rich.progress"),
    *("pyarrow", "pyarrow.parquet", "PIL.Image", "tomlkit", "filelock"),
)


def run(job: dict[str, Any]) -> int:
    """Runs the tests of a job in a fork; returns its exit code, or -SIGALRM after the limit."""
    child = os.fork()
    if child == 0:
        _run_tests(job)
    return wait(child, job["seconds"])


def wait(child: int, seconds: float) -> int:
    """Waits for a fork that leads a process group; returns its exit code, or -SIGALRM after the
    limit.
    """
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            _end_group(child)
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    _end_group(child)
    os.waitpid(child, 0)
    return -signal.SIGALRM


def _run_tests(job: dict[str, Any]) -> None:
    """Runs pytest in this process, in a process group of its own, and ends the process."""
    code = 99
    try:
        redirect(job)
        import pytest  # noqa: PLC0415 (imported by the parent)

        code = int(pytest.main(job["arguments"]))
    finally:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
        os._exit(code)


def redirect(job: dict[str, Any]) -> None:
    """Gives a fork a process group, the output file and the environment of a job."""
    os.setsid()
    output = os.open(job["output"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.environ.update(job["env"])


def _end_group(group: int) -> None:
    """Ends what the tests have started and left."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def main() -> int:
    """Imports the packages and answers jobs until the input ends."""
    for name in PACKAGES:
        with suppress(ImportError):
            importlib.import_module(name)
    reading, writing = map(int, os.environ.pop("HEXAPOD_JOBS").split(","))
    with os.fdopen(reading) as jobs, os.fdopen(writing, "w") as answers:
        for line in jobs:
            print(json.dumps(run(json.loads(line))), file=answers, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
