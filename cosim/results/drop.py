"""Measures the restitution that a drop delivers, from the speeds of its impacts.

A robot that flies freely comes back to the height at which its feet left the ground with the speed
at which they left it. So the speed of an impact over that of the impact before is the restitution
that the ground delivered, without any error of sampling. The peaks of the force are those that the
plant tracks, which do not depend on sampling either.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.window import View, is_drop, robot_weight
from hexapod_cosim.models import CONTACT_LAWS
from hexapod_cosim.models.contact.law import CHI, achieved_restitution

MEASURED = ("impact_speed", "landings", "peak_force")  # outputs of the plant, of each foot
MOST = 5  # impacts that are reported


@dataclass(frozen=True)
class Bounce:
    """An impact, and the restitution that follows from the speed of the next one."""

    time: float  # s    of the first row with contact
    speed: float  # m/s    of the impact, mean over the feet
    peak: float  # BW    largest normal force of a foot before the next impact
    restitution: float  # 1


@dataclass(frozen=True)
class Drop:
    """The restitution of a drop."""

    asked: float | None  # contact.restitution; None: the law has no such parameter
    of_the_law: float | None  # that the law delivers, by its closed form
    bounces: tuple[Bounce, ...]

    @property
    def text(self) -> str:
        """The drop as one sentence."""
        asked = "no restitution" if self.asked is None else f"restitution {self.asked:.3g}"
        law = "" if self.of_the_law is None else f", the law gives {self.of_the_law:.4f}"
        delivered = ", ".join(
            f"{bounce.restitution:.4f} at {bounce.speed:.3g} m/s (peak {bounce.peak:.3g} BW)"
            for bounce in self.bounces
        )
        return f"Asked for {asked}{law}; delivered {delivered}."


def describe_drop(view: View) -> Drop | None:
    """Returns the restitution of a run that begins in free flight without any command.

    It is None for other runs, and for a robot that never flies again. Impacts slower than
    `contact.impact_speed_floor` are left out: there the law does not deliver what it is asked for.
    """
    recording = view.recording
    needed = {name for each in MEASURED for name in foot_names(each)}
    if not is_drop(recording) or not needed <= set(recording.names):
        return None
    in_contact = _in_contact(recording)
    begins = np.flatnonzero(in_contact[1:] & ~in_contact[:-1]) + 1
    # all feet have touched down by the end of a landing, which is the row before the next flight
    ends = [_end(in_contact, begin) for begin in begins.tolist()]
    speeds = recording.feet("impact_speed")[ends].mean(axis=1)
    peaks = recording.feet("peak_force").max(axis=1) / robot_weight(view.parameters)
    floor = view.parameters.get("contact.impact_speed_floor", 0.0)
    bounces = [
        Bounce(
            time=float(recording.time[begin]),
            speed=float(before),
            peak=float(peaks[begin:following].max()),
            restitution=float(after / before),
        )
        for begin, following, before, after in zip(
            begins[:-1], begins[1:], speeds[:-1], speeds[1:], strict=True
        )
        if before > floor
    ]
    asked, law = asked_restitution(view.parameters)
    return Drop(asked, law, tuple(bounces[:MOST])) if bounces else None


def _in_contact(recording: Recording) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Returns whether a foot is in contact at a row, or was between the row before and it (rows,).

    On stiff ground an impact may be shorter than the time between two rows.
    """
    counts = recording.feet("landings").sum(axis=1)
    landed = np.diff(counts, prepend=counts[0]) > 0.0
    return np.asarray((recording.feet("contact") > 0.5).any(axis=1) | landed)


def _end(in_contact: np.ndarray[Any, np.dtype[np.bool_]], begin: int) -> int:
    """Returns the last row of a landing that begins in a row."""
    flight = np.flatnonzero(~in_contact[begin:])
    return begin + int(flight[0]) - 1 if len(flight) else len(in_contact) - 1


def asked_restitution(parameters: Mapping[str, float]) -> tuple[float | None, float | None]:
    """Returns the restitution asked for, and the one that the law delivers by its closed form."""
    law = CONTACT_LAWS[round(parameters["contact.law"]) - 1]
    if law not in CHI:
        return None, 1.0 if law == "hertz" else None
    asked = parameters["contact.restitution"]
    return asked, achieved_restitution(CHI[law](asked))
