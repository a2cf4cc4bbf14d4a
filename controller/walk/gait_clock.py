"""Tells which legs stand and swing, period by period (C2, C50, C55). C: gait_clock.h.

The gait clock divides the walk into sections. A section lasts from one lift-off or touch-down to
the next; the same legs are in the air throughout.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, some
from hexapod_cosim.controller.walk.gait import Gait

CLOCK_EPSILON = 1e-9  # cycles    the clock starts this much before the first lift-off
NO_LEG: Mask = np.zeros(LEGS, dtype=np.bool_)


class GaitClock(Stateful):
    """Phases of the legs, and the legs that stand and swing in the present section.

    Attributes, (6,) each unless stated otherwise:
        walking: the clock runs (scalar).
        before: periods from the begin of the walk to the first step of the section (scalar).
        swinging: legs in the air.
        standing: legs that stand by the clock. A leg that skips its step stands although the clock
            says that it swings: it is neither in `standing` nor in `swinging`.
        lifted: legs that lift off at the begin of the section.
        stayed: legs that skipped their last step.
        stays: legs that will skip their next step: in their stance under a body at rest.
        waiting: the clock stands still until feet at the ends of their swings carry load (scalar).
        awaited: feet that it waits for.
        ending: another gait follows: legs finish their steps and begin no other (scalar).
        offset: phases at the begin of the walk [cycles].
        late: legs that stand at the begin of the walk although the clock says that they swing, or
            that they take up their loads.
        absent: legs out of service, which neither stand nor swing.
        dropped: legs that end their swings at once, straight down (C58).
    """

    STATE = (
        "walking", "before", "swinging", "standing", "lifted", "stayed", "stays", "waiting",
        "awaited", "ending", "offset", "late", "absent", "dropped",
    )  # fmt: skip

    def __init__(self, gait: Gait, *, period: float) -> None:
        """Stops the clock at its begin. period: of the controller [s]."""
        self.gait, self.period = gait, period
        self.handover = 0.0  # cycles    in which a leg takes up or gives up its load (C18)
        self.offset: Array
        self.absent = self.dropped = NO_LEG
        self.late: Mask
        self.start_at(np.array(gait.offsets) + gait.start_clock())
        self.walking, self.before, self.waiting, self.ending = False, 0, False, False
        self.swinging = self.standing = self.lifted = self.stays = self.awaited = NO_LEG
        self.stayed: Mask = self.late

    def start_at(self, begin: Array) -> None:
        """Sets the phases (6,) at the begin of the walk [cycles]."""
        first = begin + CLOCK_EPSILON
        self.offset = begin - CLOCK_EPSILON
        # the walk begins in the time of their swing, or while they take up their loads
        phase = first - np.floor(first)
        self.late = (phase >= self.gait.duty) | (phase < 0.5 * self.handover)

    def stop(self) -> None:
        """Stops the clock at its begin, with all legs standing."""
        self.walking, self.before, self.waiting, self.ending = False, 0, False, False
        self.swinging = self.standing = self.lifted = self.stays = self.awaited = NO_LEG
        self.stayed, self.dropped = self.late, NO_LEG

    def start_standing(self, returning_leg: int | None) -> None:
        """Begins the walk anew with legs that all stand (C55), but for one that swings (C58)."""
        self.before, self.waiting, self.ending, self.dropped = 0, False, False, NO_LEG
        self.swinging = self.lifted = self.stays = self.awaited = NO_LEG
        self.standing, self.stayed = self._stands_after(0), self.late
        if returning_leg is not None:
            self.swinging = np.arange(LEGS) == returning_leg
            self.stayed = self.stayed & ~self.swinging

    # -------------------------------------------------------------------------------- phases

    def phase_after(self, number: int) -> Array:
        """Returns the phases (6,) `number` periods after the begin of the walk (C2)."""
        clock = self.offset + number * self.period / self.gait.period
        return np.asarray(clock - np.floor(clock))

    def _stands_after(self, number: int) -> Mask:
        """Returns the legs in service (6,) that stand by the clock after `number` periods."""
        return np.asarray((self.phase_after(number) < self.gait.duty) & ~self.absent)

    def reached(self, number: int) -> int:
        """Returns the periods on the clock `number` periods after the section began (C50)."""
        return self.before if self.waiting else self.before + number

    def progress(self, phase: Array) -> Array:
        """Returns the completed parts tau of the swings (6,) at these phases (C2)."""
        return (phase - self.gait.duty) / (1.0 - self.gait.duty)

    @property
    def unloads(self) -> float:
        """Returns the phase at which a standing leg begins to give up its load [cycles]."""
        return self.gait.duty - 0.5 * self.handover

    # ------------------------------------------------------------------------------ sections

    def begin_section(self, number: int) -> None:
        """Begins a section `number` periods after the last one, and finds the legs that lift off.

        The legs in `lifted` swing from set_out() on.
        """
        self.before = self.reached(number) if self.walking else 0
        self.waiting, self.awaited = False, NO_LEG
        stood = self.phase_after(self.before) < self.gait.duty
        self.standing = self._stands_after(self.before + 1)
        self.lifted = stood & ~self.standing & ~self.absent
        self.stayed = self.stayed | self.lifted
        self.swinging = self.swinging & (~self.standing | self.dropped) & ~self.absent
        self.stays = NO_LEG

    def keep_down(self, kept: Mask) -> None:
        """Lets the legs skip their next steps that have not begun to give up their loads (C55).

        kept: (6,) legs that were to skip them already.
        """
        phase = self.phase_after(self.before)
        leaving = (phase >= self.unloads) & (phase < self.gait.duty) & ~kept
        leaving = leaving & ~self.dropped.any()
        self.stays = (~self.swinging & ~leaving) | self.absent
        self.lifted = self.lifted & ~self.stays

    def drop(self) -> None:
        """Ends the swings at once; the walk ends with them (C58)."""
        self.swinging = self.swinging & ~self.absent
        self.ending, self.dropped, self.waiting = True, self.swinging, False
        self.awaited = NO_LEG

    def land(self, down: Mask) -> None:
        """Lets dropped legs (6,) that are down stand."""
        down = down & self.dropped
        self.swinging, self.stayed = self.swinging & ~down, self.stayed | down

    def skip(self, home: Mask) -> bool:
        """Lets the legs skip their steps whose feet are in their stance positions (6,).

        Returns whether all legs stand there.
        """
        home = home | self.absent
        self.lifted = self.lifted & ~home
        self.stays = home & ~self.swinging
        return bool(home.all() and not (self.swinging | self.lifted).any())

    def set_out(self) -> None:
        """Lifts the legs off that are in `lifted`."""
        self.swinging = self.swinging | self.lifted
        self.stayed = self.stayed & ~self.lifted
        self.walking = True

    def hold(self, number: int) -> None:
        """Begins a section in which the clock stands still (C50). number: as for landing()."""
        self.awaited = self.landing(number)
        self.before = self.reached(number)
        self.waiting, self.lifted = True, NO_LEG

    def landing(self, number: int) -> Mask:
        """Returns the legs (6,) whose swing ends at the present step.

        While the clock stands still, these are the legs whose swing ended when it stopped.

        number: periods since the section began.
        """
        if not self.walking or some(self.dropped):
            return NO_LEG
        stands = self.phase_after(self.reached(number) + 1) < self.gait.duty
        return np.asarray(self.swinging & stands)

    def reach(self, number: int) -> bool:
        """Returns whether the step `number` periods after the first belongs to the section.

        It does if no leg lifts off or touches down before it.
        """
        if not self.walking or self.waiting or number == 1:
            return True
        return not some(self._stands_after(self.before + number) != self.standing)

    def ended(self) -> bool:
        """Returns whether all legs stand and begin no other step, because another gait follows."""
        return self.ending and not self.waiting and bool(self.stays.all())
