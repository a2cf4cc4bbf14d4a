"""Keeps macro-steps in step with wall time, and counts those that come late.

Step k is due to begin at t_k = origin + k h and misses its deadline when it ends after t_(k+1).
A lag of less than MOST_LAG is made up by steps without a pause between them. After a larger one the
origin moves: the gap is skipped and counted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

MOST_LAG = 0.1  # s    behind wall time
WINDOW = 1.0  # s    over which the real-time factor is taken


@dataclass
class Lateness:
    """Counts since the loop began; times in s."""

    steps: int = 0
    misses: int = 0  # steps that ended after the next one was due
    worst: float = 0.0  # s    largest time by which a step ended late
    skipped: float = 0.0  # s    of wall time in gaps


class Pacer:
    """Computes the time to wait before a macro-step of `h` [s]; `now` returns wall time [s]."""

    def __init__(self, h: float, now: Callable[[], float]) -> None:
        self._h, self._now = h, now
        self.lateness = Lateness()
        self._ends: deque[float] = deque(maxlen=max(round(WINDOW / h), 2) + 1)
        self.restart()

    def restart(self) -> None:
        """Makes the next step due now, after a pause that was asked for; nothing is counted."""
        self._due = self._now()
        self._ends.clear()

    def wait(self) -> float:
        """Returns the time [s] until the next step is due; skips a gap that is too large."""
        left = self._due - self._now()
        if left < -MOST_LAG:
            self.lateness.skipped -= left
            self.restart()
            return 0.0
        return max(left, 0.0)

    def note_step(self) -> None:
        """Notes that the step that was due has ended."""
        end, count = self._now(), self.lateness
        self._due += self._h
        count.steps += 1
        if end > self._due:
            count.misses += 1
            count.worst = max(count.worst, end - self._due)
        self._ends.append(end)

    @property
    def factor(self) -> float:
        """Simulated time over wall time of the last second; 0 before two steps."""
        if len(self._ends) < 2 or self._ends[-1] <= self._ends[0]:
            return 0.0
        return (len(self._ends) - 1) * self._h / (self._ends[-1] - self._ends[0])
