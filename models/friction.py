"""Computes friction: the tanh law (eq. 15, 35), elasto-plastic bristles (eq. 16-18), LuGre (eq. 36,
37), and the moments of spin and rolling (eq. 38).

Velocities and deflections lie along the ground, in world axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.records import BRISTLE_LAWS, Array, Friction

SPRING_LIMIT = 0.7  # 1  of the presliding; bristles below it are springs (eq. 16)
NO_FRICTION = 1e-30  # 1  keeps ratios of coefficients finite at mu = 0


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
    """Returns db/dt (3,) [m/s] of a closed foot's bristles (eq. 16, 36); 0 without bristles."""
    if friction.law not in BRISTLE_LAWS:
        return np.zeros(3)
    return slip - yielding_velocity(friction, slip, bristle)


def yielding_velocity(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns the part (..., 3) of the slip (..., 3) [m/s] that stretches no bristle (eq. 16, 36).

    bristle: deflections (..., 3) [m] of a law with bristles.
    """
    if friction.law == "lugre":
        return lugre_sliding(friction, slip, bristle)
    return sliding_velocity(friction.presliding, slip, bristle)


def stribeck_curve(friction: Friction, sliding: Array) -> Array:
    """Returns mu(p) = mu + (mu_s - mu)/(1 + (p/v_s)^2) for sliding at p [m/s] (eq. 18).

    The shape is that of p.
    """
    above = max(friction.mu_static - friction.mu, 0.0)
    return np.asarray(friction.mu + above / (1.0 + (sliding / friction.stribeck_speed) ** 2))


def sliding_friction(friction: Friction, sliding: float) -> float:
    """Returns mu(p) of `stribeck_curve` for one speed [m/s]."""
    return float(stribeck_curve(friction, np.array(sliding)))


def bristle_force(friction: Friction, normal: float, slip: Array, bristle: Array) -> Array:
    """Returns the tangential force f_t (3,) of the bristle law [N] (eq. 17, 35).

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
    grip = sliding_friction(friction, sliding) * (spring + damped)
    return -normal * (grip + friction.viscous * slip)


@dataclass(frozen=True)
class BristleSlopes:
    """Secants of the bristles' friction -f_t/f_n, and the release rate of bristles.

    Laws without bristles have no stiffness and no release rate.
    """

    stiffness: float  # 1/m  of friction over load, by b
    damping: float  # s/m  of friction over load, by db/dt
    beta: float  # 1/s  of db/dt, by -b


def bristle_slopes(friction: Friction, slip: Array, bristle: Array) -> BristleSlopes:
    """Returns the secants at a slip velocity (3,) [m/s] and a deflection (3,) [m] (eq. 21)."""
    if friction.law == "lugre":
        return _lugre_slopes(friction, slip)
    if friction.law != "bristle":
        return BristleSlopes(0.0, friction_drag(friction, float(np.linalg.norm(slip))), 0.0)
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
    damping = mu * per_rate * share + friction.viscous
    return BristleSlopes(mu * spring / friction.presliding, damping, beta)


def _lugre_slopes(friction: Friction, slip: Array) -> BristleSlopes:
    """Returns stiffness mu_0/b_max, damping sigma and release rate of the LuGre law (eq. 37)."""
    stiffness = rest_friction(friction) / friction.presliding
    still = stiffness * friction.bristle_damping
    speed = float(np.linalg.norm(slip))
    damping = still / (1.0 + still * speed / (sliding_friction(friction, speed) + NO_FRICTION))
    release = float(lugre_release(friction, np.array(speed)))
    return BristleSlopes(stiffness, damping + friction.viscous, release)


def rest_friction(friction: Friction) -> float:
    """Returns mu_0, the coefficient of friction at rest: the larger of mu and mu_static."""
    return max(friction.mu, friction.mu_static)


def lugre_release(friction: Friction, speed: Array) -> Array:
    """Returns the rate [1/s] at which the bristles of the LuGre law yield at a slip speed [m/s].

    It is v mu_0 / (mu(v) b_max) (eq. 36), in the shape of v.
    """
    ratio = (rest_friction(friction) + NO_FRICTION) / (
        stribeck_curve(friction, speed) + NO_FRICTION
    )
    return np.asarray(speed * ratio / friction.presliding)


def lugre_sliding(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns the part (..., 3) of the slip (..., 3) [m/s] that bristles (..., 3) [m] lose by
    yielding.
    """
    speed = np.linalg.norm(slip, axis=-1, keepdims=True)
    return lugre_release(friction, speed) * bristle


def lugre_force(friction: Friction, normal: float, slip: Array, bristle: Array) -> Array:
    """Returns the tangential force f_t (3,) of the LuGre law [N] (eq. 37).

    f_t = -f_n (mu_0 b/b_max + sigma db/dt + viscous v_t). sigma = sigma_1/(1 + sigma_1 |v_t|/mu)
    falls with the speed: with a constant one the law could release energy (it is passive for
    sigma |v_t| < 4 mu) and a foot that lands sliding would feel many times mu f_n.
    """
    slopes = _lugre_slopes(friction, slip)
    sigma = slopes.damping - friction.viscous
    grip = slopes.stiffness * bristle + sigma * bristle_rate(friction, slip, bristle)
    return -normal * (grip + friction.viscous * slip)


def friction_force(
    friction: Friction, normal: float, slip: Array, bristle: Array | None = None
) -> Array:
    """Returns the tangential force f_t (3,) [N].

    The tanh law has f_t = -f_n (mu(v) tanh(k_t v) + viscous v) v_t/v, v = |v_t| (eq. 15, 35).
    bristle: deflection b (3,) [m] of laws with bristles, 0 by default.
    """
    if friction.law == "none":
        return np.zeros(3)
    if friction.law == "tanh":
        return -normal * friction_drag(friction, float(np.linalg.norm(slip))) * slip
    law = bristle_force if friction.law == "bristle" else lugre_force
    return law(friction, normal, slip, np.zeros(3) if bristle is None else bristle)


def _tanh_per_speed(friction: Friction, speed: float) -> float:
    """Returns `regularised_direction`, 0 for the law `none`."""
    return 0.0 if friction.law == "none" else regularised_direction(friction, speed)


def regularised_direction(friction: Friction, speed: float) -> float:
    """Returns tanh(k_t v)/v [s/m] at a speed [m/s], at rest k_t."""
    x = friction.slope * speed
    return math.tanh(x) / speed if x > 1e-5 else friction.slope * (1.0 - x * x / 3.0)


def friction_drag(friction: Friction, speed: float) -> float:
    """Returns the tanh law's force over load and slip speed [s/m] at a slip speed [m/s].

    It is mu(v) tanh(k_t v)/v + viscous (eq. 15, 35).
    """
    if friction.law == "none":
        return 0.0
    return sliding_friction(friction, speed) * _tanh_per_speed(friction, speed) + friction.viscous


def turning_slopes(
    friction: Friction, radius: float, normal: Array, turn: Array
) -> tuple[float, float]:
    """Returns the moments of spin and rolling friction over load and angular speed [m s] (eq. 38).

    radius: that of the sphere [m]; its speeds R |w_n| and R |w_t| regularise the moments.
    normal: (3,) of the ground; turn: angular velocity (3,) [rad/s].
    """
    spin = float(normal @ turn)
    slow = radius * abs(spin)
    fast = radius * float(np.linalg.norm(turn - spin * normal))
    return (
        friction.spin_radius
        * radius
        * sliding_friction(friction, slow)
        * _tanh_per_speed(friction, slow),
        friction.rolling_radius * radius * _tanh_per_speed(friction, fast),
    )


def turning_moment(
    friction: Friction, radius: float, load: float, normal: Array, turn: Array
) -> Array:
    """Returns the moment (3,) [N m] of spin and rolling friction at a load [N] (eq. 38).

    The other arguments are those of `turning_slopes`.
    """
    spin, roll = turning_slopes(friction, radius, normal, turn)
    about = float(normal @ turn) * normal
    return -load * (spin * about + roll * (turn - about))
