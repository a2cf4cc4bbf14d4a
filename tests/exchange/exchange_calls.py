"""Calls of model exchange and of derivatives, as an importer makes them, with arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fmi_plant import ATHENA, OK, Plant
from fmpy import simulate_fmu
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = [state.name for state in ATHENA.states]
INPUTS = [variable.name for variable in ATHENA.of_causality("input")]
UNKNOWNS = [
    variable.name for variable in ATHENA.of_causality("output", "local") if variable.type == "Real"
]
LEGS = ("LF", "LM", "LR", "RF", "RM", "RR")
ROUNDING = 1e-12  # relative to the largest number of its kind


def doubles(values: Sequence[float] | Array) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * len(values))(*values)


def fetched(plant: Plant, function: str, n: int) -> Array:
    place = doubles(np.full(n, np.nan))
    assert plant.call(function, place, ctypes.c_size_t(n)) == OK, plant.last_message
    return np.array(place)


def put_states(plant: Plant, x: Array) -> int:
    return plant.call("fmi2SetContinuousStates", doubles(x), ctypes.c_size_t(len(x)))


def directional(
    plant: Plant, unknowns: Sequence[str], knowns: Sequence[str], change: Sequence[float] | Array
) -> tuple[int, Array]:
    """Returns status and directional derivatives of the unknowns."""
    wanted, given = ATHENA.references(unknowns), ATHENA.references(knowns)
    result = doubles(np.full(len(wanted), np.nan))
    status = plant.call(
        "fmi2GetDirectionalDerivative",
        (ctypes.c_uint * len(wanted))(*wanted),
        ctypes.c_size_t(len(wanted)),
        (ctypes.c_uint * len(given))(*given),
        ctypes.c_size_t(len(given)),
        doubles(change),
        result,
    )
    return status, np.array(result)


def set_rates(plant: Plant, rates: dict[str, float], *, order: int = 1) -> int:
    references = ATHENA.references(rates)
    n = len(references)
    orders = (ctypes.c_int * n)(*[order] * n)
    return plant.call(
        "fmi2SetRealInputDerivatives",
        (ctypes.c_uint * n)(*references),
        ctypes.c_size_t(n),
        orders,
        doubles(list(rates.values())),
    )


def output_rates(plant: Plant, names: Sequence[str]) -> Array:
    references, n = ATHENA.references(names), len(names)
    result = doubles(np.zeros(n))
    orders = (ctypes.c_int * n)(*[1] * n)
    assert (
        plant.call(
            "fmi2GetRealOutputDerivatives",
            (ctypes.c_uint * n)(*references),
            ctypes.c_size_t(n),
            orders,
            result,
        )
        == OK
    )
    return np.array(result)


def solved_by_cvode(fmu: Path, tolerance: float, **asked: Any) -> NDArray[Any]:
    """Returns fmpy's result (rows,) with named fields of a run in model exchange with CVode.

    tolerance: relative, of the solver. asked: further arguments of fmpy's simulate_fmu.
    """
    result: NDArray[Any] = simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=tolerance,
        record_events=False,
        **asked,
    )
    return result
