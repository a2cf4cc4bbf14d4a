"""Computes the contact force of a foot: normal force with restitution (eq. 14), friction (eq.
15-18).

f_n = K delta^1.5 max(0, 1 + d ddelta). Touch-down fixes d [s/m] by the approach speed, and d holds
until lift-off. Most laws have the form d = chi(e) / v0 and differ in chi(e).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, foot_centres
from hexapod_cosim.models.records import Array, Contact, Friction, Robot
from hexapod_cosim.models.terrain import Face, ground_faces

SPRING_LIMIT = 0.7  # 1  of the presliding; bristles below it are springs (eq. 16)
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


CHI: dict[str, Callable[[float], float]] = {
    "exact_restitution": exact_restitution_chi,
    "flores": lambda e: 8.0 * (1.0 - e) / (5.0 * e),
    "lankarani_nikravesh": lambda e: 0.75 * (1.0 - e * e),
    "hunt_crossley": lambda e: 1.5 * (1.0 - e),
}


def contact_damping(contact: Contact, impact_speed: float) -> float:
    """Returns d [s/m] of a foot that touches down at this approach speed [m/s], or at the floor if
    slower.
    """
    if contact.law == "hertz":
        return 0.0
    if contact.law == "constant_damping":
        return 1.5 * contact.damping_factor
    return CHI[contact.law](contact.restitution) / max(impact_speed, contact.impact_speed_floor)


def normal_force(contact: Contact, damping: float, delta: float, ddelta: float) -> float:
    """Returns f_n >= 0 [N] at penetration delta [m] and approach speed ddelta [m/s] (eq. 14).

    damping: d [s/m]; nan: no contact.
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
    """Returns the derivatives of `normal_force` by delta [N/m] and by ddelta [N s/m]."""
    factor = 1.0 + damping * ddelta
    if math.isnan(damping) or factor <= 0.0:
        return 0.0, 0.0
    root = math.sqrt(max(delta, 0.0))
    return 1.5 * contact.stiffness * root * factor, contact.stiffness * root**3 * damping


def bristle_yield(share: Array) -> Array:
    """Returns Y: the share of the slip along a bristle that is sliding, in the shape of the input.

    share: deflection over presliding. Y rises from 0 at SPRING_LIMIT to 1 at 1 and is C1.
    """
    s = np.clip((share - SPRING_LIMIT) / (1.0 - SPRING_LIMIT), 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))


def sliding_velocity(presliding: float, slip: Array, bristle: Array) -> Array:
    """Returns the plastic part (..., 3) of the slip velocity (..., 3) [m/s] (eq. 16).

    It is Y (v_t.u)+ u/|u| with u = b/b_max; the rest stretches the bristles.
    """
    u = bristle / presliding
    share = np.linalg.norm(u, axis=-1, keepdims=True)
    along = np.maximum(np.sum(slip * u, axis=-1, keepdims=True), 0.0)
    return np.asarray(bristle_yield(share) * along / np.maximum(share, SPRING_LIMIT) * u)


def bristle_rate(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns db/dt (3,) [m/s] of a closed foot's bristles (eq. 16)."""
    return slip - sliding_velocity(friction.presliding, slip, bristle)


def sliding_friction(friction: Friction, sliding: float) -> float:
    """Returns mu(p) = mu + (mu_s - mu)/(1 + (p/v_s)^2) for sliding at p [m/s] (eq. 18)."""
    above = max(friction.mu_static - friction.mu, 0.0)
    return friction.mu + above / (1.0 + (sliding / friction.stribeck_speed) ** 2)


def bristle_force(friction: Friction, normal: float, slip: Array, bristle: Array) -> Array:
    """Returns the tangential force f_t (3,) of the bristle law [N] (eq. 17).

    f_t = -mu(p) f_n (u (3 - u.u)/2 + d room/|(room, d)|) with u = b/b_max, limited to length 1, and
    d = 3/2 tau db/dt / b_max. The spring leaves room = 1 - |u| (3 - u.u)/2 to the damping, so that
    friction stays within its cone.

    p is the speed of the plastic part of the slip, so that a foot that sticks has static friction
    at any slip velocity.
    """
    u = bristle / friction.presliding
    d = 1.5 * friction.bristle_damping / friction.presliding * bristle_rate(friction, slip, bristle)
    u = u / max(float(np.linalg.norm(u)), 1.0)
    spring = u * (3.0 - u @ u) / 2.0
    room, push = 1.0 - float(np.linalg.norm(spring)), float(np.linalg.norm(d))
    damped = d * (room / math.hypot(room, push)) if push > 0.0 else d
    sliding = float(np.linalg.norm(sliding_velocity(friction.presliding, slip, bristle)))
    return -sliding_friction(friction, sliding) * normal * (spring + damped)


@dataclass(frozen=True)
class BristleSlopes:
    """Secants of the bristles' friction -f_t/f_n, and the release rate of bristles."""

    stiffness: float  # 1/m  of friction over load, by b
    damping: float  # s/m  of friction over load, by db/dt
    beta: float  # 1/s  of db/dt, by -b


def bristle_slopes(friction: Friction, slip: Array, bristle: Array) -> BristleSlopes:
    """Returns the secants at a slip velocity (3,) [m/s] and a deflection (3,) [m] (eq. 17, 21)."""
    u = bristle / friction.presliding
    size, sliding = float(np.linalg.norm(u)), sliding_velocity(friction.presliding, slip, bristle)
    spring = (3.0 - min(size, 1.0) ** 2) / (2.0 * max(size, 1.0))
    per_rate = 1.5 * friction.bristle_damping / friction.presliding
    push = per_rate * float(np.linalg.norm(slip - sliding))
    room = 1.0 - spring * size
    share = room / math.hypot(room, push) if push > 0.0 or room > 0.0 else 0.0
    mu = sliding_friction(friction, float(np.linalg.norm(sliding)))
    beta = float(bristle_yield(np.array(size))) * max(float(slip @ u), 0.0)
    beta /= max(size, SPRING_LIMIT) * friction.presliding
    return BristleSlopes(mu * spring / friction.presliding, mu * per_rate * share, beta)


def friction_force(
    friction: Friction, normal: float, slip: Array, bristle: Array | None = None
) -> Array:
    """Returns the tangential force f_t (3,) [N].

    The tanh law has f_t = -mu f_n tanh(k_t |v_t|) v_t/|v_t|, at rest -mu f_n k_t v_t (eq. 15).
    bristle: deflection b (3,) [m] of the bristle law, 0 by default.
    """
    if friction.law == "none":
        return np.zeros(3)
    if friction.law == "bristle":
        return bristle_force(friction, normal, slip, np.zeros(3) if bristle is None else bristle)
    return -normal * friction_drag(friction, float(np.linalg.norm(slip))) * slip


def friction_drag(friction: Friction, speed: float) -> float:
    """Returns mu tanh(k_t |v_t|)/|v_t| [s/m]: the tanh law's force over load and slip speed [m/s]
    (eq. 15).
    """
    if friction.law == "none":
        return 0.0
    x = friction.slope * speed
    return friction.mu * (
        math.tanh(x) / speed if x > 1e-5 else friction.slope * (1.0 - x * x / 3.0)
    )


@dataclass(frozen=True)
class FootContact:
    """Contact of a foot with the ground, world axes."""

    point: Array  # (3,) m    centre - R n
    velocity: Array  # (3,) m/s  of the foot's material at the contact point
    normal: Array  # (3,)
    penetration: float  # m    delta, < 0: clearance
    approach_speed: float  # m/s  ddelta


def foot_contact(robot: Robot, tibia: Array, centre: Array) -> FootContact:
    """Returns the contact of a foot with the ground below it.

    It is that of the surface, or of the top of the block over which the foot's centre is.

    Args:
        robot: the robot.
        tibia: (13,) state of the foot's tibia.
        centre: (3,) of the foot [m].
    """
    return _contact(robot, tibia, centre, ground_faces(robot.terrain, centre)[0])


def _contact(robot: Robot, tibia: Array, centre: Array, face: Face) -> FootContact:
    """Returns the contact of a foot with one face of the ground."""
    distance, normal = face
    point = centre - robot.foot.radius * normal
    velocity = tibia[7:10] + cross(tibia[10:13], point - tibia[0:3])
    return FootContact(
        point, velocity, normal, robot.foot.radius - distance, float(-velocity @ normal)
    )


def wall_contacts(robot: Robot, body: Array) -> tuple[FootContact | None, ...]:
    """Returns the second contacts of the six feet of bodies (19, 13), with walls and edges.

    Only surfaces of blocks have walls; None where there is none beside a foot.
    """
    found: list[FootContact | None] = []
    for leg, centre in enumerate(foot_centres(robot, body)):
        walls = ground_faces(robot.terrain, centre)[1:]
        tibia = body[JOINTS * (leg + 1)]
        found.append(_contact(robot, tibia, centre, walls[0]) if walls else None)
    return tuple(found)


def foot_contacts(robot: Robot, body: Array) -> tuple[FootContact, ...]:
    """Returns the contacts of the six feet of bodies (19, 13)."""
    centres = foot_centres(robot, body)
    return tuple(foot_contact(robot, body[JOINTS * (leg + 1)], centres[leg]) for leg in range(LEGS))


def foot_force(
    robot: Robot, foot: FootContact, damping: float, bristle: Array | None = None
) -> Array:
    """Returns the force (3,) of the ground on the foot [N]: f_n n + f_t.

    bristle: (3,) as in `friction_force`.
    """
    f_n = normal_force(robot.contact, damping, foot.penetration, foot.approach_speed)
    slip = foot.velocity + foot.approach_speed * foot.normal
    return f_n * foot.normal + friction_force(robot.friction, f_n, slip, bristle)


def standing_damping(robot: Robot, body: Array) -> Array:
    """Returns the damping (6,) [s/m] at impact speed 0; nan for feet above the ground."""
    slow = contact_damping(robot.contact, 0.0)
    return np.array(
        [slow if foot.penetration > 0.0 else math.nan for foot in foot_contacts(robot, body)]
    )
