"""Paces macro-steps by wall time.

Step k is due to begin at t_k = origin + k h. A lag of less than MOST_LAG is made up by steps
without a pause between them. After a larger one the origin moves: the gap is skipped and counted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

MOST_LAG = 0.1  # s    behind wall time
WINDOW = 1.0  # s    over which the real-time factor is taken


class Pacer:
    """Computes the time to wait before a macro-step of `h` [s]; `now` returns wall time [s].

    Attributes:
        steps: macro-steps since the loop began.
        skipped: wall time [s] in gaps.
    """

    def __init__(self, h: float, now: Callable[[], float]) -> None:
        self._h, self._now = h, now
        self.steps, self.skipped = 0, 0.0
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
            self.skipped -= left
            self.restart()
            return 0.0
        return max(left, 0.0)

    def note_step(self) -> None:
        """Notes that the step that was due has ended."""
        self._due += self._h
        self.steps += 1
        self._ends.append(self._now())

    @property
    def factor(self) -> float:
        """Simulated time over wall time of the last second; 0 before two steps."""
        if len(self._ends) < 2 or self._ends[-1] <= self._ends[0]:
            return 0.0
        return (len(self._ends) - 1) * self._h / (self._ends[-1] - self._ends[0])
