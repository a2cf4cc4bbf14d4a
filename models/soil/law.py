"""Computes the forces of soft ground on a foot: virgin curve, unloading, damping and shear.

The depth z of the foot's lowest point under the undisturbed surface is >= 0 in contact. A monotone
loading follows the virgin curve F_v(z) of the soil's law. Unloading and reloading follow the line
A Ke (z - z_p) with the plastic depth z_p, the largest z - F_v(z)/(A Ke) so far. Shear stretches a
bristle b whose force is the Janosi-Hanamoto curve. plant_fmu/src/ground/soil.c is the fast form,
with the same names.

A foot is a sphere of radius R = foot.radius, or on soil a flat round pad of foot.pad_radius.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Foot
from hexapod_cosim.models.soil.presets import SOIL_LAWS, Soil

REACHED = 1e-8  # m  short of the virgin curve: links are off their joints by less
# fields of a law's virgin curve, in the order of a material's columns 4 to 6
CURVES: dict[str, tuple[str, ...]] = {
    "none": (),
    "bekker": ("frictional_modulus", "cohesive_modulus", "exponent"),
    "granular": ("resistance", "alpha_down", "alpha_ahead"),
    "mud": ("yield_pressure", "hardening"),
}
BISECTIONS = 200  # halvings of an interval, more than doubles resolve


def soil_radius(foot: Foot) -> float:
    """Returns the radius b [m] of the foot's pad, or of its sphere."""
    return foot.pad_radius if foot.pad_radius > 0.0 else foot.radius


def soil_area(foot: Foot) -> float:
    """Returns A = pi b^2 [m^2], the area that unloading refers to."""
    return math.pi * soil_radius(foot) ** 2


def contact_area(foot: Foot, z: float) -> float:
    """Returns the area [m^2] of the foot's cross-section at the surface, at depth z [m]."""
    if foot.pad_radius > 0.0 or z >= foot.radius:
        return soil_area(foot)
    return math.pi * (2.0 * foot.radius - z) * z


def bekker_modulus(soil: Soil, foot: Foot) -> float:
    """Returns k = Kc/b + Kphi [N/m^(n+2)] of the pressure k z^n (eq. 40)."""
    return soil.cohesive_modulus / soil_radius(foot) + soil.frictional_modulus


def column_sum(foot: Foot, z: float, n: float) -> tuple[float, float]:
    """Returns the integral of (local depth)^n over the foot's area [m^(n+2)] and its derivative by
    z > 0 (eq. 41).

    The columns under a sphere end at its lower half: a sphere deeper than R has columns under its
    whole area.
    """
    if foot.pad_radius > 0.0:
        A = soil_area(foot)
        return float(A * z**n), float(A * n * z ** (n - 1.0))
    R, above = foot.radius, max(z - foot.radius, 0.0)
    whole = z ** (n + 1.0) * (R / (n + 1.0) - z / ((n + 1.0) * (n + 2.0)))
    rest = above ** (n + 2.0) / ((n + 1.0) * (n + 2.0))
    slope = z**n * (R - z / (n + 1.0)) + above ** (n + 1.0) / (n + 1.0)
    return float(2.0 * math.pi * (whole + rest)), float(2.0 * math.pi * slope)


def bekker_sum(soil: Soil, foot: Foot, z: float) -> tuple[float, float]:
    """Returns force [N] and slope [N/m] of k z^n over the foot at depth z [m] (eq. 40)."""
    k, (force, slope) = bekker_modulus(soil, foot), column_sum(foot, z, soil.exponent)
    return k * force, k * slope


def granular_sum(soil: Soil, foot: Foot, z: float) -> tuple[float, float]:
    """Returns force [N] and slope [N/m] of granular media at depth z [m] (eq. 42).

    A surface element under the angle beta resists with side + (down - side) cos^2 beta times its
    depth; the lower half of the sphere counts.
    """
    down, side = soil.resistance * soil.alpha_down, soil.resistance * soil.alpha_side
    if foot.pad_radius > 0.0:
        A = soil_area(foot)
        return down * A * z, down * A
    R, e, rest = foot.radius, z / foot.radius, down - side
    if e <= 1.0:
        o = 1.0 - e
        force = side * e**2 / 2 + rest * (o * o * e**2 / 2 + 2 * o * e**3 / 3 + e**4 / 4)
        slope = side * e + rest * (o * o * e + o * e**2 + e**3 / 3)
    else:
        force = side * (e - 0.5) + rest * ((e - 1.0) / 3 + 0.25)
        slope = side + rest / 3
    return 2 * math.pi * R**3 * force, 2 * math.pi * R**2 * slope


def mud_sum(soil: Soil, foot: Foot, z: float) -> tuple[float, float]:
    """Returns force [N] and slope [N/m] of mud at depth z [m] (eq. 43)."""
    p, H = soil.yield_pressure, soil.hardening
    flat, deep = column_sum(foot, z, 0.0), column_sum(foot, z, 1.0)
    return p * flat[0] + H * deep[0], p * flat[1] + H * deep[1]


SUMS = {"bekker": bekker_sum, "granular": granular_sum, "mud": mud_sum}


def virgin_force(soil: Soil, foot: Foot, z: float) -> float:
    """Returns F_v [N], the force of a first monotone loading to depth z [m] (eq. 40-43)."""
    return SUMS[soil.law](soil, foot, z)[0] if z > 0.0 else 0.0


def virgin_slope(soil: Soil, foot: Foot, z: float) -> float:
    """Returns dF_v/dz [N/m] at z > 0."""
    return SUMS[soil.law](soil, foot, z)[1]


def sinkage(soil: Soil, foot: Foot, load: float) -> float:
    """Returns the depth z [m] at which the virgin curve bears a load [N], by bisection."""
    low, high = 0.0, 1e-6
    while virgin_force(soil, foot, high) < load and high < 1e6:
        high *= 2.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if virgin_force(soil, foot, middle) < load else (low, middle)
    return high


def unloading_stiffness(soil: Soil, foot: Foot) -> float:
    """Returns A Ke [N/m], the slope of unloading."""
    return soil_area(foot) * soil.stiffness


def plastic_depth(soil: Soil, foot: Foot, z: float) -> float:
    """Returns z - F_v(z)/(A Ke) [m]: the depth that stays when depth z is unloaded (eq. 44)."""
    return max(z - virgin_force(soil, foot, z) / unloading_stiffness(soil, foot), 0.0)


def elastic_force(soil: Soil, foot: Foot, plastic: float, z: float) -> float:
    """Returns min(A Ke (z - z_p), F_v(z)) >= 0 [N] at plastic depth z_p [m] (eq. 44)."""
    if z <= plastic:
        return 0.0
    line = unloading_stiffness(soil, foot) * (z - plastic)
    return min(line, virgin_force(soil, foot, z))


def stored_energy(soil: Soil, foot: Foot, plastic: float, z: float) -> float:
    """Returns the energy [J] that unloading gives back: F^2/(2 A Ke)."""
    force = elastic_force(soil, foot, plastic, z)
    return force * force / (2.0 * unloading_stiffness(soil, foot))


def soil_normal_force(soil: Soil, foot: Foot, plastic: float, z: float, dz: float) -> float:
    """Returns f_n >= 0 [N] at depth z [m] and sinking speed dz [m/s]: elastic force and R A dz (eq.
    45).
    """
    if z <= plastic:
        return 0.0
    viscous = soil.damping * contact_area(foot, z) * dz
    return max(elastic_force(soil, foot, plastic, z) + viscous, 0.0)


def is_yielding(soil: Soil, foot: Foot, plastic: float, z: float, dz: float) -> bool:
    """Returns whether a foot that sinks at dz [m/s] presses the soil further.

    At the end of each step that does, the line reaches the curve (eq. 44), so that rounding decides
    which of them is less.
    """
    line = unloading_stiffness(soil, foot) * (z - plastic + REACHED)
    return dz > 0.0 and virgin_force(soil, foot, z) <= line


def soil_normal_slopes(
    soil: Soil, foot: Foot, plastic: float, z: float, dz: float
) -> tuple[float, float]:
    """Returns the derivatives of `soil_normal_force` by z [N/m] and by dz [N s/m]."""
    if soil_normal_force(soil, foot, plastic, z, dz) <= 0.0:
        return 0.0, 0.0
    line = unloading_stiffness(soil, foot)
    yields = virgin_force(soil, foot, z) < line * (z - plastic)
    slope = virgin_slope(soil, foot, z) if yields else line
    widens = foot.pad_radius == 0.0 and z < foot.radius
    area_slope = 2.0 * math.pi * (foot.radius - z) if widens else 0.0
    return slope + soil.damping * area_slope * dz, soil.damping * contact_area(foot, z)


def profile_moment(foot: Foot, z: float) -> float:
    """Returns the integral of depth over the foot's profile under the surface [m^3].

    The profile of a pad is the rectangle 2 a z, that of a sphere the segment of a circle.
    """
    if foot.pad_radius > 0.0:
        return foot.pad_radius * z * z
    R, c = foot.radius, foot.radius - z
    if c <= -R:
        return math.pi * R * R * (z - R)
    chord = math.sqrt((R - c) * (R + c))
    return 2.0 / 3.0 * chord**3 - c * (R * R * math.atan2(chord, c) - c * chord)


def shear_base(soil: Soil, foot: Foot, z: float) -> float:
    """Returns the shear force [N] at depth z [m] that does not depend on the load (eq. 46).

    Cohesion over the contact area, and in granular media the resistance of the foot's profile.
    """
    base = soil.cohesion * contact_area(foot, z)
    if soil.law != "granular":
        return base
    return base + soil.resistance * soil.alpha_ahead * profile_moment(foot, z)


def shear_limit(soil: Soil, foot: Foot, z: float, load: float) -> float:
    """Returns T_max [N], the largest shear force at depth z [m] under a normal force (eq. 46)."""
    return shear_base(soil, foot, z) + load * math.tan(soil.friction_angle)


def shear_rate(soil: Soil, slip: Array, bristle: Array) -> Array:
    """Returns db/dt = v - |v| b/K (3,) [m/s] (eq. 47)."""
    return slip - float(np.linalg.norm(slip)) / soil.shear_displacement * bristle


def shear_force(soil: Soil, limit: float, bristle: Array) -> Array:
    """Returns the shear force -T_max b/K (3,) [N] (eq. 47)."""
    return -limit / soil.shear_displacement * bristle


def table_row(soil: Soil) -> tuple[float, ...]:
    """Returns columns 3 to 15 of a material in a grid's table; unused ones are 0.

    Column 3 is the law; 4-6 are Kphi, Kc, n (bekker), resistance, alpha_down, alpha_ahead
    (granular) or yield pressure and hardening (mud); 7-11 are c, tan phi, K, Ke, R; 12 is
    alpha_side.
    """
    curve = [getattr(soil, name) for name in CURVES[soil.law]]
    unused = [0.0] * (3 - len(curve))
    law = float(SOIL_LAWS.index(soil.law))
    shear = (soil.cohesion, math.tan(soil.friction_angle), soil.shear_displacement)
    rest = (soil.stiffness, soil.damping, soil.alpha_side, 0.0, 0.0, 0.0)
    return (law, *curve, *unused, *shear, *rest)


def row_soil(row: Array) -> Soil:
    """Returns the soil of columns 3 to 15 of a material in a grid's table (`table_row`)."""
    law, first, second, third, cohesion, friction, displacement, stiffness, damping, side, *_ = (
        float(number) for number in row
    )
    name = SOIL_LAWS[int(law)]
    if name == "none":
        return Soil()
    return Soil(
        law=name,
        cohesion=cohesion,
        friction_angle=math.atan(friction),
        shear_displacement=displacement,
        stiffness=stiffness,
        damping=damping,
        alpha_side=side,
        **dict(zip(CURVES[name], (first, second, third), strict=False)),
    )


def stored_power(soil: Soil, foot: Foot, plastic: float, z: float, dz: float) -> float:
    """Returns the growth [W] of F^2/(2 A Ke) at depth z [m] and sinking speed dz [m/s].

    On the virgin curve F grows by its slope, on the line of unloading by A Ke.
    """
    force = elastic_force(soil, foot, plastic, z)
    if is_yielding(soil, foot, plastic, z, dz):
        return force * virgin_slope(soil, foot, z) / unloading_stiffness(soil, foot) * dz
    return force * dz


def lost_power(soil: Soil, foot: Foot, plastic: float, z: float, dz: float) -> float:
    """Returns the power [W] of f_n that neither is stored nor comes back."""
    taken = soil_normal_force(soil, foot, plastic, z, dz) * dz
    return taken - stored_power(soil, foot, plastic, z, dz)
