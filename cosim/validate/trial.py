"""Runs the binary of an FMU that is validated, in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process


def problems_of_a_trial(run: Callable[[Path], list[str]], path: Path) -> list[str]:
    """Returns the problems that `run` finds, or the one that its process ended early.

    A damaged binary may end the process that loads it.
    """
    try:
        return [str(problem) for problem in call_in_process(run, path)]
    except ProcessEndedError as error:
        return [
            f"binaries: loading the FMU and stepping it ended the process: got {error}, expected "
            "a step; fix: the binary is damaged or made for another system, export the FMU again"
        ]
