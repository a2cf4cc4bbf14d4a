"""Computes the powers that soft ground takes from a foot and stores."""

from __future__ import annotations

from hexapod_cosim.models.records import Foot, Soil
from hexapod_cosim.models.soil.law import (
    elastic_force,
    is_yielding,
    soil_normal_force,
    unloading_stiffness,
    virgin_slope,
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
