"""Reports how far an identification is: its step, and how many simulations were made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hexapod_cosim.extensions.identify.fitting.last_search import FINISHING
from hexapod_cosim.extensions.identify.fitting.output_error import SEARCH

COLUMNS, LINEAR = "the columns of the log", "linear least squares"
MODELS = "friction models M1 to M6"  # a step before all others
AGAIN = "again, without columns that do not fit"
BEFORE_FIT = 2  # steps
# of a fit: searches, other starts, all rows, the last search, what the log tells
MOST_STEPS = BEFORE_FIT + len(SEARCH) + 2 + FINISHING + 1


@dataclass(frozen=True)
class Done:
    """What an identification does now and has done before."""

    text: str  # what is being done
    step: int  # from 1 to MOST_STEPS; a second fit counts anew from the first fit on
    simulations: int  # of all steps


Progress = Callable[[Done], None]


class Reporter:
    """Counts steps and simulations and calls a progress function with them, if there is one."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._done = progress, Done("", 0, 0)

    def begin(self, text: str) -> None:
        """Reports that the next step begins."""
        step = BEFORE_FIT if text == AGAIN else self._done.step + 1
        self._tell(Done(text, step, self._done.simulations))

    def simulated(self) -> None:
        """Reports that one more simulation was made."""
        done = self._done
        self._tell(Done(done.text, done.step, done.simulations + 1))

    def _tell(self, done: Done) -> None:
        self._done = done
        if self._progress is not None:
            self._progress(done)
