"""Defines what touches, and the normal contact laws: the data of a contact and its force with
restitution (eq. 14).

f_n = K delta^1.5 max(0, 1 + d ddelta). Touch-down fixes d [s/m] by the approach speed, and d holds
until lift-off. Most laws have the form d = chi(e) / v0 and differ in chi(e).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from hexapod_cosim.models.arrays import Vector3
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.schema import Choice, Number, Vector
from hexapod_cosim.models.soil.presets import Soil

BODY_CONTACTS = ("off", "on")
SELF_CONTACTS = ("off", "warn", "force")


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Normal contact law (eq. 14)."""

    law: Annotated[str, Choice(CONTACT_LAWS)]
    # default of a file: Hertz, sphere on rigid ground
    stiffness: Annotated[float, Number("N/m^1.5", above=0.0)]
    restitution: Annotated[float, Number("1", at_least=0.0, at_most=1.0)]
    damping_factor: Annotated[float, Number("s/m", at_least=0.0)]  # c of the constant law
    impact_speed_floor: Annotated[float, Number("m/s", above=0.0)]


@dataclass(frozen=True, kw_only=True)
class BodyContact:
    """Spheres that touch the ground besides the feet; parts of size 0 do not.

    The radii of knee and shank are also those of femur and tibia, as capsules, in the distances
    between neighbouring legs, which do not depend on `contact`.
    """

    contact: Annotated[str, Choice(BODY_CONTACTS)] = "off"
    # whether a run warns of neighbouring legs that overlap, or these push each other
    self_contact: Annotated[str, Choice(SELF_CONTACTS)] = "off"
    # half edges of a box along the torso's axes, with a sphere around each corner
    torso_box: Annotated[Vector3, Vector("m", 3)] = (0.0, 0.0, 0.0)
    # centre of the box, from the torso's origin
    torso_centre: Annotated[Vector3, Vector("m", 3)] = (0.0, 0.0, 0.0)
    corner_radius: Annotated[float, Number("m", at_least=0.0)] = 0.0
    knee_radius: Annotated[float, Number("m", at_least=0.0)] = 0.0
    shank_radius: Annotated[float, Number("m", at_least=0.0)] = 0.0
    # of the shank's sphere: 0 at the tibia's joint, 1 at the foot's centre
    shank_position: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.5

    @property
    def tibia_spheres(self) -> list[tuple[str, float, float]]:
        """Name, radius [m] and place of knee and shank, 0 at the joint to 1 at the foot."""
        parts = [("knee", self.knee_radius, 0.0), ("shank", self.shank_radius, self.shank_position)]
        return [part for part in parts if part[1] > 0.0]


@dataclass(frozen=True)
class ContactState:
    """State of a contact, which holds from touch-down to lift-off."""

    contact: Contact  # with the stiffness of the ground where it touched down
    friction: Friction
    soil: Soil
    damping: float = math.nan  # s/m  d of eq. 14; nan: open
    impact_speed: float = 0.0  # m/s  at the last touch-down

    @property
    def is_open(self) -> bool:
        """Whether the sphere does not touch the face."""
        return math.isnan(self.damping)

    @property
    def is_soft(self) -> bool:
        """Whether the contact is on soil."""
        return self.soil.law != "none"

    @property
    def has_bristles(self) -> bool:
        """Whether a sole has bristles, those of friction or of shear in soil."""
        return self.is_soft or self.friction.has_bristles


# below it the closed form of _log_rest loses more digits than its series omits
SERIES_BELOW = 1e-2
SERIES_TERMS = 9


def _log_rest(x: float) -> float:
    """Returns (ln(1 + x) - x) / x^2 without cancellation near 0, for x > -1."""
    if abs(x) < SERIES_BELOW:
        return sum((-1.0) ** (n + 1) * x ** (n - 2) / n for n in range(2, 2 + SERIES_TERMS))
    return (math.log1p(x) - x) / (x * x)


def _balance(chi: float, e: float) -> float:
    """Returns [ln(1 + chi) - ln(1 - chi e) - chi (1 + e)] / chi^2.

    It is 0 for a law with chi whose restitution is exactly e.
    """
    return _log_rest(chi) - e * e * _log_rest(-chi * e) if chi * e < 1.0 else math.inf


def _bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Returns the root, to the last bit, of a function that is negative at low and positive at
    high.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def exact_restitution_chi(e: float) -> float:
    """Returns chi of the law with exact restitution e in (0, 1].

    It solves chi (1 + e) = ln[(1 + chi)/(1 - chi e)].
    """
    return 0.0 if e >= 1.0 else _bisect(lambda chi: _balance(chi, e), 0.0, 1.0 / e)


def achieved_restitution(chi: float) -> float:
    """Returns the restitution of a law with chi > 0, from the same equation solved for e."""
    return 1.0 if chi <= 0.0 else _bisect(lambda e: _balance(chi, e), 0.0, min(1.0, 1.0 / chi))


@dataclass(frozen=True)
class ContactLaw:
    """A row of the table: what determines d at touch-down, one of both."""

    chi: Callable[[float], float] | None = None  # of the restitution: d = chi / v0
    damping: Callable[[Contact], float] | None = None  # s/m  a d that does not depend on v0


# in the order of their numbers in the FMU, so that a new law is the last one
LAWS = {
    "exact_restitution": ContactLaw(chi=exact_restitution_chi),
    "flores": ContactLaw(chi=lambda e: 8.0 * (1.0 - e) / (5.0 * e)),
    "lankarani_nikravesh": ContactLaw(chi=lambda e: 0.75 * (1.0 - e * e)),
    "hunt_crossley": ContactLaw(chi=lambda e: 1.5 * (1.0 - e)),
    "constant_damping": ContactLaw(damping=lambda contact: 1.5 * contact.damping_factor),
    "hertz": ContactLaw(damping=lambda _: 0.0),
}
CONTACT_LAWS = tuple(LAWS)
CHI = {name: law.chi for name, law in LAWS.items() if law.chi is not None}


def contact_damping(contact: Contact, impact_speed: float) -> float:
    """Returns d [s/m] of a foot that touches down at this approach speed [m/s], or at the floor if
    slower.
    """
    damping = LAWS[contact.law].damping
    if damping is not None:
        return damping(contact)
    return CHI[contact.law](contact.restitution) / max(impact_speed, contact.impact_speed_floor)


def normal_force(contact: Contact, damping: float, delta: float, ddelta: float) -> float:
    """Returns f_n >= 0 [N] at penetration delta [m] and approach speed ddelta [m/s] (eq. 14).

    damping: d [s/m]; nan: no contact.
    """
    if math.isnan(damping):
        return 0.0
    return contact.stiffness * float(max(delta, 0.0) ** 1.5) * max(0.0, 1.0 + damping * ddelta)


def normal_slopes(
    contact: Contact, damping: float, delta: float, ddelta: float
) -> tuple[float, float]:
    """Returns the derivatives of `normal_force` by delta [N/m] and by ddelta [N s/m]."""
    factor = 1.0 + damping * ddelta
    if math.isnan(damping) or factor <= 0.0:
        return 0.0, 0.0
    root = math.sqrt(max(delta, 0.0))
    return 1.5 * contact.stiffness * root * factor, contact.stiffness * root**3 * damping
