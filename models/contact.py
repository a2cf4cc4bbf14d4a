"""Foot on ground: normal force with restitution (eq. 14) and friction (eq. 15; bristles: eq.
16-18).

f_n = K delta^1.5 max(0, 1 + d ddelta), with d [s/m] fixed at touch-down from the approach speed
there and held to lift-off. Most laws are of the form d = chi(e) / v0; chi(e) is what tells them
apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, foot_centres
from hexapod_cosim.models.records import Array, Contact, Friction, Robot
from hexapod_cosim.models.terrain import ground

BREAK_AWAY = 0.7  # of the presliding: below it a bristle is a spring
SERIES_BELOW = (
    1e-2  # where the closed form of _log_rest has lost more digits than its series leaves out
)
SERIES_TERMS = 9


def _log_rest(x: float) -> float:
    """(ln(1 + x) - x) / x^2, without cancellation near 0; -inf as x -> -1 is not reached by its
    callers' brackets.
    """
    if abs(x) < SERIES_BELOW:
        return sum((-1.0) ** (n + 1) * x ** (n - 2) / n for n in range(2, 2 + SERIES_TERMS))
    return (math.log1p(x) - x) / (x * x)


def _balance(chi: float, e: float) -> float:
    """[ln(1 + chi) - ln(1 - chi e) - chi (1 + e)] / chi^2: 0 where a law with chi gives back
    exactly e.
    """
    return _log_rest(chi) - e * e * _log_rest(-chi * e) if chi * e < 1.0 else math.inf


def _bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """The root of a function that is negative at low and positive at high, to the last bit."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def exact_restitution_chi(e: float) -> float:
    """chi of the law that gives back exactly the restitution e in (0, 1]: chi (1 + e) = ln[(1 +
    chi)/(1 - chi e)].
    """
    return 0.0 if e >= 1.0 else _bisect(lambda chi: _balance(chi, e), 0.0, 1.0 / e)


def achieved_restitution(chi: float) -> float:
    """The restitution that a law with this chi > 0 really gives back: the same equation solved
    for e.
    """
    return 1.0 if chi <= 0.0 else _bisect(lambda e: _balance(chi, e), 0.0, min(1.0, 1.0 / chi))


CHI: dict[str, Callable[[float], float]] = {
    "exact_restitution": exact_restitution_chi,
    "flores": lambda e: 8.0 * (1.0 - e) / (5.0 * e),
    "lankarani_nikravesh": lambda e: 0.75 * (1.0 - e * e),
    "hunt_crossley": lambda e: 1.5 * (1.0 - e),
}


def contact_damping(contact: Contact, impact_speed: float) -> float:
    """d [s/m] of a foot that touches down with this approach speed [m/s]; slower ones count as
    the floor.
    """
    if contact.law == "hertz":
        return 0.0
    if contact.law == "constant_damping":
        return 1.5 * contact.damping_factor
    return CHI[contact.law](contact.restitution) / max(impact_speed, contact.impact_speed_floor)


def normal_force(contact: Contact, damping: float, delta: float, ddelta: float) -> float:
    """f_n [N] at penetration delta [m] and approach speed ddelta [m/s]; never pulls. Damping
    nan: not in contact.
    """
    if math.isnan(damping):
        return 0.0
    return contact.stiffness * float(max(delta, 0.0) ** 1.5) * max(0.0, 1.0 + damping * ddelta)


def normal_slopes(
    contact: Contact,
    damping: float,
    delta: float,
    ddelta: float,
) -> tuple[float, float]:
    """Slopes of `normal_force`: stiffness by delta [N/m] and viscosity by ddelta [N s/m]."""
    factor = 1.0 + damping * ddelta
    if math.isnan(damping) or factor <= 0.0:
        return 0.0, 0.0
    root = math.sqrt(max(delta, 0.0))
    return 1.5 * contact.stiffness * root * factor, contact.stiffness * root**3 * damping


def bristle_yield(share: Array) -> Array:
    """Y (any shape): how much of the slip along a bristle is sliding, from 0 at break-away to 1
    at the presliding, a share of 1; C1.
    """
    s = np.clip((share - BREAK_AWAY) / (1.0 - BREAK_AWAY), 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))


def sliding_velocity(presliding: float, slip: Array, bristle: Array) -> Array:
    """(..., 3) Y (v_t.u)+ u/|u|, u = b/b_max: what of the slip velocity (..., 3) [m/s] the foot
    does not get back (eq. 16).
    """
    u = bristle / presliding
    share = np.linalg.norm(u, axis=-1, keepdims=True)
    along = np.maximum(np.sum(slip * u, axis=-1, keepdims=True), 0.0)
    return np.asarray(bristle_yield(share) * along / np.maximum(share, BREAK_AWAY) * u)


def bristle_rate(friction: Friction, slip: Array, bristle: Array) -> Array:
    """(3,) db/dt [m/s] of a closed foot's bristles (eq. 16)."""
    return slip - sliding_velocity(friction.presliding, slip, bristle)


def sliding_friction(friction: Friction, sliding: float) -> float:
    """mu(p) = mu + (mu_s - mu)/(1 + (p/v_s)^2) of a foot that slides at p [m/s] (eq. 18).

    Static at rest, kinetic well above v_s.
    """
    above = max(friction.mu_static - friction.mu, 0.0)
    return friction.mu + above / (1.0 + (sliding / friction.stribeck_speed) ** 2)


def bristle_force(friction: Friction, normal: float, slip: Array, bristle: Array) -> Array:
    """(3,) f_t = -mu(p) f_n (u (3 - u.u)/2 + d room/|(room, d)|) [N], u = b/b_max, d = 3/2 tau
    db/dt / b_max (eq. 17).

    p is the speed of what the foot slides and does not get back: a foot that sticks has static
    friction however it swings.

    The spring leaves the damping a room of 1 - |u| (3 - u.u)/2, so that friction stays in its cone;
    u is cut to its presliding.
    """
    u, d = (
        bristle / friction.presliding,
        1.5
        * friction.bristle_damping
        / friction.presliding
        * bristle_rate(friction, slip, bristle),
    )
    u = u / max(float(np.linalg.norm(u)), 1.0)
    spring = u * (3.0 - u @ u) / 2.0
    room, push = 1.0 - float(np.linalg.norm(spring)), float(np.linalg.norm(d))
    damped = d * (room / math.hypot(room, push)) if push > 0.0 else d
    sliding = float(np.linalg.norm(sliding_velocity(friction.presliding, slip, bristle)))
    return -sliding_friction(friction, sliding) * normal * (spring + damped)


@dataclass(frozen=True)
class BristleSlopes:
    """Secants of the bristles' friction -f_t/f_n, and of how fast they let go."""

    stiffness: float  # 1/m  of friction over load, by b
    damping: float  # s/m  of friction over load, by db/dt
    beta: float  # 1/s  of db/dt, by -b


def bristle_slopes(friction: Friction, slip: Array, bristle: Array) -> BristleSlopes:
    """The secants at a slip velocity (3,) [m/s] and a deflection (3,) [m] (eq. 17, 21)."""
    u = bristle / friction.presliding
    size, sliding = float(np.linalg.norm(u)), sliding_velocity(friction.presliding, slip, bristle)
    spring = (3.0 - min(size, 1.0) ** 2) / (2.0 * max(size, 1.0))
    per_rate = 1.5 * friction.bristle_damping / friction.presliding
    push = per_rate * float(np.linalg.norm(slip - sliding))
    room = 1.0 - spring * size
    share = room / math.hypot(room, push) if push > 0.0 or room > 0.0 else 0.0
    mu = sliding_friction(friction, float(np.linalg.norm(sliding)))
    beta = float(bristle_yield(np.array(size))) * max(float(slip @ u), 0.0)
    beta /= max(size, BREAK_AWAY) * friction.presliding
    return BristleSlopes(mu * spring / friction.presliding, mu * per_rate * share, beta)


def friction_force(
    friction: Friction, normal: float, slip: Array, bristle: Array | None = None
) -> Array:
    """(3,) f_t = -mu f_n tanh(k_t |v_t|) v_t/|v_t| [N], with its limit -mu f_n k_t v_t at rest; the
    bristles' with that law.

    bristle: (3,) their deflection b [m], slack unless given.
    """
    if friction.law == "none":
        return np.zeros(3)
    if friction.law == "bristle":
        return bristle_force(friction, normal, slip, np.zeros(3) if bristle is None else bristle)
    return -normal * friction_drag(friction, float(np.linalg.norm(slip))) * slip


def friction_drag(friction: Friction, speed: float) -> float:
    """mu tanh(k_t |v_t|)/|v_t| [s/m]: the tanh law's force over load and slip speed [m/s], eq.
    15.
    """
    if friction.law == "none":
        return 0.0
    x = friction.slope * speed
    return friction.mu * (
        math.tanh(x) / speed if x > 1e-5 else friction.slope * (1.0 - x * x / 3.0)
    )


@dataclass(frozen=True)
class FootContact:
    """One foot at the ground, world axes."""

    point: Array  # (3,) m    centre - R n
    velocity: Array  # (3,) m/s  of the foot's material point there
    normal: Array  # (3,)
    penetration: float  # m    delta, < 0: clearance
    approach_speed: float  # m/s  ddelta


def foot_contact(robot: Robot, tibia: Array, centre: Array) -> FootContact:
    """Where and how a foot of this tibia (13,) with this centre (3,) meets the ground."""
    distance, normal = ground(robot.terrain, centre)
    point = centre - robot.foot.radius * normal
    velocity = tibia[7:10] + cross(tibia[10:13], point - tibia[0:3])
    return FootContact(
        point, velocity, normal, robot.foot.radius - distance, float(-velocity @ normal)
    )


def foot_contacts(robot: Robot, body: Array) -> tuple[FootContact, ...]:
    """The six feet of bodies (19, 13)."""
    centres = foot_centres(robot, body)
    return tuple(foot_contact(robot, body[JOINTS * (leg + 1)], centres[leg]) for leg in range(LEGS))


def foot_force(
    robot: Robot, foot: FootContact, damping: float, bristle: Array | None = None
) -> Array:
    """(3,) ground on foot [N]: f_n n + f_t; bristle (3,) as in `friction_force`."""
    f_n = normal_force(robot.contact, damping, foot.penetration, foot.approach_speed)
    slip = foot.velocity + foot.approach_speed * foot.normal
    return f_n * foot.normal + friction_force(robot.friction, f_n, slip, bristle)


def standing_damping(robot: Robot, body: Array) -> Array:
    """(6,) damping of feet put down slowly where they are in the ground, nan where they are not."""
    slow = contact_damping(robot.contact, 0.0)
    return np.array(
        [slow if foot.penetration > 0.0 else math.nan for foot in foot_contacts(robot, body)]
    )
