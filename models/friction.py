"""Defines friction: the data of a material and its laws, tanh (eq. 15, 35), elasto-plastic bristles
(eq. 16-18) and LuGre (eq. 36, 37).

Velocities and deflections lie along the ground, in world axes. A law is a function and its row in
LAWS.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.schema import Choice, Number

SPRING_LIMIT = 0.7  # 1  of the presliding; bristles below it are springs (eq. 16)
TANH_LIMIT = 0.999  # 1    of the largest force, where the tanh law is inverted
NO_FRICTION = 1e-30  # 1  keeps ratios of coefficients finite at mu = 0


@dataclass(frozen=True, kw_only=True)
class Friction:
    """Friction law (eq. 15-18, 35-38)."""

    law: Annotated[str, Choice(FRICTION_LAWS)]
    mu: Annotated[float, Number("1", at_least=0.0)]
    # static friction; 0: mu
    mu_static: Annotated[float, Number("1", at_least=0.0)] = 0.0
    slope: Annotated[float, Number("s/m", above=0.0)]  # k_t of eq. 15, tanh law, and of eq. 38
    # b_max of eq. 16 and 36, laws with bristles; default of a file: Mindlin
    presliding: Annotated[float, Number("m", at_least=1e-7, at_most=1.0)]
    # tau of eq. 17 and 37, laws with bristles
    bristle_damping: Annotated[float, Number("s", at_least=0.0, at_most=10.0)] = 0.005
    # v_s of eq. 18
    stribeck_speed: Annotated[float, Number("m/s", at_least=1e-6, at_most=100.0)] = 0.005
    # of eq. 35: what a slip of 1 m/s adds to the coefficient
    viscous: Annotated[float, Number("s/m", at_least=0.0, at_most=1e6)] = 0.0
    # r_s and r_r of eq. 38: moments against spin over mu f_n and against rolling over f_n
    spin_radius: Annotated[float, Number("m", at_least=0.0, at_most=10.0)] = 0.0
    rolling_radius: Annotated[float, Number("m", at_least=0.0, at_most=10.0)] = 0.0

    @property
    def has_friction(self) -> bool:
        """Whether the law has forces along the ground."""
        return LAWS[self.law].has_friction

    @property
    def has_bristles(self) -> bool:
        """Whether a foot can hold under the law: it stands on bristles."""
        return LAWS[self.law].has_bristles

    @property
    def creeps(self) -> bool:
        """Whether a foot creeps under any force along the ground."""
        return LAWS[self.law].creep is not None


@dataclass(frozen=True)
class Grip:
    """Friction of a contact at a slip velocity and a deflection, with its secants over the load."""

    force: Array  # (3,) N  f_t
    damping: float  # s/m  of -f_t/f_n, by the slip; with bristles by db/dt
    stiffness: float = 0.0  # 1/m  of -f_t/f_n, by b
    relaxation: float = 0.0  # 1/s  beta of eq. 21: of db/dt, by -b


# laws without bristles


def sliding_grip(friction: Friction, normal: float, slip: Array, bristle: Array) -> Grip:
    """Returns f_t = -f_n (mu(v) g(v) + viscous) v_t, v = |v_t|, with g of the law (eq. 15, 35)."""
    drag = friction_drag(friction, float(np.linalg.norm(slip)))
    return Grip(-normal * drag * slip, drag)


def stribeck_curve(friction: Friction, sliding: Array | float) -> Array:
    """Returns mu(p) = mu + (mu_s - mu)/(1 + (p/v_s)^2) for sliding at p [m/s] (eq. 18).

    The shape is that of p.
    """
    above = max(friction.mu_static - friction.mu, 0.0)
    x = np.asarray(sliding) / friction.stribeck_speed
    return np.asarray(friction.mu + above / (1.0 + x**2))


def no_friction(friction: Friction, speed: float) -> float:
    """Returns g = 0."""
    return 0.0


def regularised_direction(friction: Friction, speed: float) -> float:
    """Returns g = tanh(k_t v)/v [s/m] at a speed [m/s], at rest k_t (eq. 15)."""
    x = friction.slope * speed
    return math.tanh(x) / speed if x > 1e-5 else friction.slope * (1.0 - x * x / 3.0)


def tanh_creep(friction: Friction, share: Array) -> Array:
    """Returns the slip speed [m/s] at which the tanh law has these shares of mu f_n (eq. 15)."""
    return np.asarray(np.arctanh(np.minimum(share, TANH_LIMIT)) / friction.slope)


def friction_direction(friction: Friction, speed: float) -> float:
    """Returns g of the law [s/m] at a speed [m/s]: f_t = -mu f_n g(|v_t|) v_t (eq. 15)."""
    return LAWS[friction.law].direction(friction, speed)


def friction_drag(friction: Friction, speed: float) -> float:
    """Returns the force over load and slip speed [s/m] of a law without bristles.

    It is mu(v) g(v) + viscous (eq. 15, 35) at a slip speed [m/s]; without friction 0.
    """
    if not friction.has_friction:
        return 0.0
    along = friction_direction(friction, speed)
    return float(stribeck_curve(friction, speed)) * along + friction.viscous


# bristles


def bristle_yield(share: Array) -> Array:
    """Returns Y: the share of the slip along a bristle that is sliding, in the shape of the input.

    share: deflection over presliding. Y rises from 0 at SPRING_LIMIT to 1 at 1 and is C1.
    """
    s = np.clip((share - SPRING_LIMIT) / (1.0 - SPRING_LIMIT), 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))


def bristle_sliding(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns the plastic part (..., 3) of the slip velocity (..., 3) [m/s] (eq. 16).

    It is Y (v_t.u)+ u/|u| with u = b/b_max; the rest stretches the bristles.
    """
    u = bristle / friction.presliding
    share = np.linalg.norm(u, axis=-1, keepdims=True)
    along = np.maximum(np.sum(slip * u, axis=-1, keepdims=True), 0.0)
    return np.asarray(bristle_yield(share) * along / np.maximum(share, SPRING_LIMIT) * u)


def bristle_friction(friction: Friction, normal: float, slip: Array, bristle: Array) -> Grip:
    """Returns the friction of elasto-plastic bristles (eq. 17, 21, 35).

    f_t = -mu(p) f_n (u (3 - u.u)/2 + d room/|(room, d)|) with u = b/b_max, limited to length 1, and
    d = 3/2 tau db/dt / b_max. The spring leaves room = 1 - |u| (3 - u.u)/2 to the damping, so that
    friction stays within its cone.

    p is the speed of the plastic part of the slip, so that a foot that sticks has static friction
    at any slip velocity.
    """
    plastic = bristle_sliding(friction, slip, bristle)
    mu = float(stribeck_curve(friction, float(np.linalg.norm(plastic))))
    per_rate = 1.5 * friction.bristle_damping / friction.presliding
    u, d = bristle / friction.presliding, per_rate * (slip - plastic)
    size, push = float(np.linalg.norm(u)), float(np.linalg.norm(d))
    spring = (3.0 - min(size, 1.0) ** 2) / (2.0 * max(size, 1.0))
    room = 1.0 - spring * size
    share = room / math.hypot(room, push) if push > 0.0 or room > 0.0 else 0.0
    force = -normal * (mu * (spring * u + share * d) + friction.viscous * slip)
    relaxation = float(bristle_yield(np.array(size))) * max(float(slip @ u), 0.0)
    relaxation /= max(size, SPRING_LIMIT) * friction.presliding
    damping = mu * per_rate * share + friction.viscous
    return Grip(force, damping, mu * spring / friction.presliding, relaxation)


# LuGre


def rest_friction(friction: Friction) -> float:
    """Returns mu_0, the coefficient of friction at rest: the larger of mu and mu_static."""
    return max(friction.mu, friction.mu_static)


def lugre_relaxation(friction: Friction, speed: Array) -> Array:
    """Returns the rate [1/s] at which the bristles of the LuGre law yield at a slip speed [m/s].

    It is v mu_0 / (mu(v) b_max) (eq. 36), in the shape of v.
    """
    ratio = (rest_friction(friction) + NO_FRICTION) / (
        stribeck_curve(friction, speed) + NO_FRICTION
    )
    return np.asarray(speed * ratio / friction.presliding)


def lugre_sliding(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns the part (..., 3) of the slip (..., 3) [m/s] that bristles lose by yielding."""
    speed = np.linalg.norm(slip, axis=-1, keepdims=True)
    return lugre_relaxation(friction, speed) * bristle


def lugre_friction(friction: Friction, normal: float, slip: Array, bristle: Array) -> Grip:
    """Returns the friction of the LuGre law (eq. 37).

    f_t = -f_n (mu_0 b/b_max + sigma db/dt + viscous v_t). sigma = sigma_1/(1 + sigma_1 |v_t|/mu)
    falls with the speed: with a constant one the law could release energy (it is passive for
    sigma |v_t| < 4 mu) and a foot that lands sliding would feel many times mu f_n.
    """
    stiffness = rest_friction(friction) / friction.presliding
    still = stiffness * friction.bristle_damping
    speed = float(np.linalg.norm(slip))
    sigma = still / (1.0 + still * speed / (float(stribeck_curve(friction, speed)) + NO_FRICTION))
    rate = slip - lugre_sliding(friction, slip, bristle)
    force = -normal * (stiffness * bristle + sigma * rate + friction.viscous * slip)
    relaxation = float(lugre_relaxation(friction, np.array(speed)))
    return Grip(force, sigma + friction.viscous, stiffness, relaxation)


# the table


@dataclass(frozen=True)
class FrictionLaw:
    """A row of the table: all that other files ask about a law."""

    # g(v) [s/m] at a speed [m/s]; of laws with bristles that of the moments (eq. 38)
    direction: Callable[[Friction, float], float] = regularised_direction
    # the slip speed [m/s] of shares of mu f_n; None: no foot creeps
    creep: Callable[[Friction, Array], Array] | None = None
    # of load [N], slip and deflection
    grip: Callable[[Friction, float, Array, Array], Grip] = sliding_grip
    # the part (..., 3) of the slip that stretches no bristle [m/s]; None: no bristles
    sliding: Callable[[Friction, Array, Array], Array] | None = None

    @property
    def has_friction(self) -> bool:
        """Whether the law has forces along the ground."""
        return self.direction is not no_friction

    @property
    def has_bristles(self) -> bool:
        """Whether a foot stands on bristles."""
        return self.sliding is not None


# in the order of their numbers in the FMU, so that a new law is the last one
LAWS = {
    "tanh": FrictionLaw(creep=tanh_creep),
    "none": FrictionLaw(no_friction),
    "bristle": FrictionLaw(grip=bristle_friction, sliding=bristle_sliding),
    "lugre": FrictionLaw(grip=lugre_friction, sliding=lugre_sliding),
}
FRICTION_LAWS = tuple(LAWS)


def friction_grip(friction: Friction, normal: float, slip: Array, bristle: Array) -> Grip:
    """Returns the friction under a load [N] at a slip velocity (3,) [m/s] and a deflection [m]."""
    return LAWS[friction.law].grip(friction, normal, slip, bristle)


def friction_force(
    friction: Friction, normal: float, slip: Array, bristle: Array | None = None
) -> Array:
    """Returns the tangential force f_t (3,) [N]; bristle: deflection (3,) [m], 0 by default."""
    deflection = np.zeros(3) if bristle is None else bristle
    return friction_grip(friction, normal, slip, deflection).force


def yielding_velocity(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns the part (..., 3) of the slip (..., 3) [m/s] that stretches no bristle (eq. 16, 36).

    bristle: deflections (..., 3) [m].
    """
    sliding = LAWS[friction.law].sliding
    return slip if sliding is None else sliding(friction, slip, bristle)


def bristle_rate(friction: Friction, slip: Array, bristle: Array) -> Array:
    """Returns db/dt (3,) [m/s] of a closed foot's bristles (eq. 16, 36); 0 without bristles."""
    return slip - yielding_velocity(friction, slip, bristle)
