"""Describes robot and ground of a run for the viewer, from the FMU's parameters and the surface.

A height of a surface is reproduced within range/131070: 4 um if heights differ by half a metre.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.documentation import COLOURS, THICKNESS
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.report.columns import pack
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.support import FLAT, SLOPE
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, HexapodError, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.files import parse_toml
from hexapod_cosim.models.ground.faces import surface_heights
from hexapod_cosim.models.ground.patches import PROPERTIES
from hexapod_cosim.models.ground.smooth import RUN_OUT
from hexapod_cosim.models.ground.surface import LAW, MU, Surface

Parameters = Mapping[str, float]

FLATNESS = 0.25  # height of a torso of unknown size, relative to the width between its hips
FINE = 0.0125  # m    spacing of the samples of a smooth surface, if it is not too large for it
MOST_NODES = 250_000  # of a drawn surface; a finer one is drawn with every second, third ... node
SOIL, SLIPPERY, PATCH = "soil", "slippery", "patch"  # what a material is drawn as
UNITS = {"mu": "", "mu_static": "", "stiffness": " N/m^1.5"}


def describe_robot(run: StoredResult) -> dict[str, Any]:
    """Returns torso, feet and legs [m, rad], with colours and thicknesses of the FMU's picture."""
    return describe_shape(run.view.parameters, torso_size(run))


def describe_shape(parameters: Parameters, size: Sequence[float]) -> dict[str, Any]:
    """Returns what `describe_robot` does, from an FMU's parameters and the torso's edges [m]."""
    return {
        "torso": {"com": _vector(parameters, "torso.com"), "size": list(size)},
        "foot": parameters["foot.radius"],
        "legs": [_leg(parameters, leg) for leg in LEG_NAMES],
        "joints": list(JOINT_NAMES),
        "colours": {
            name: f"rgb({red},{green},{blue})" for name, (red, green, blue) in COLOURS.items()
        },
        "thickness": list(THICKNESS),
    }


def _leg(parameters: Parameters, leg: str) -> dict[str, Any]:
    links = [
        {
            "axis": _vector(parameters, f"{leg}.{joint}.axis"),
            "tip": [
                parameters[f"{leg}.{joint}.{part}"] for part in ("length", "offset_y", "offset_z")
            ],
        }
        for joint in JOINT_NAMES
    ]
    return {
        "name": leg,
        "hip": _vector(parameters, f"{leg}.hip_position"),
        "yaw": parameters[f"{leg}.hip_yaw"],
        "links": links,
    }


def torso_size(run: StoredResult) -> list[float]:
    """Returns the edges of the torso [m], from the robot file or, without it, from the hips."""
    try:
        return [float(edge) for edge in load_robot(parse_toml(run.scenario)["robot"]).torso.size]
    except (HexapodError, KeyError, TypeError, tomllib.TOMLDecodeError):
        hips = np.array([_vector(run.view.parameters, f"{leg}.hip_position") for leg in LEG_NAMES])
        length, width = np.ptp(hips[:, :2], axis=0).tolist()
        return [length, width, FLATNESS * width]


def describe_ground(parameters: Parameters) -> dict[str, float]:
    """Returns the plane of a ground: height [m] at the origin, rise per metre, heading [rad] of it.

    The heights of a surface are above the height; it has no rise.
    """
    slope = parameters.get("terrain.kind", FLAT) == SLOPE
    return {
        "height": parameters.get("terrain.height", 0.0),
        "rise": math.tan(parameters.get("terrain.incline", 0.0)) if slope else 0.0,
        "heading": parameters.get("terrain.heading", 0.0),
    }


def _vector(parameters: Parameters, stem: str) -> list[float]:
    return [parameters[name] for name in vector_names(stem)]


def pack_surface(surface: Surface, parameters: Mapping[str, float]) -> dict[str, Any]:
    """Returns a surface for the viewer (scene/surface.ts): its grid, heights and materials.

    A smooth surface is sampled finely, with the run-out of its slope beyond the border, so that the
    viewer needs no law of its own between samples. Heights [m] and materials are columns, row by
    row.
    """
    x, y, height, material = _sampled(surface)
    columns = {"height": height.ravel()}
    if material is not None:
        columns["material"] = material.ravel().astype(np.float64)
    return {
        "kind": surface.kind,
        "across": height.shape[1],
        "x0": float(x[0]),
        "y0": float(y[0]),
        "cell": float(x[1] - x[0]),
        "materials": material_legend(surface, parameters),
        **pack(np.zeros(height.size), columns),
    }


def _sampled(surface: Surface) -> tuple[Array, Array, Array, NDArray[np.uint8] | None]:
    """Returns x (columns,), y (rows,), heights (rows, columns) [m] and materials of a grid."""
    every, parts, margin = stride(surface), 1, 0
    if surface.kind == "smooth" and every == 1:
        most = math.isqrt(MOST_NODES // surface.height.size)
        parts = max(min(round(surface.cell / FINE), most), 1)
        margin = math.ceil(RUN_OUT * parts / surface.cell)
    along = [
        np.arange(-margin, (count - 1) * parts + margin + 1, every)
        for count in (surface.columns, surface.rows)
    ]
    x = surface.x0 + along[0] * surface.cell / parts
    y = surface.y0 + along[1] * surface.cell / parts
    columns, rows = (
        np.clip(np.round(each / parts).astype(int), 0, count - 1)
        for each, count in zip(along, (surface.columns, surface.rows), strict=True)
    )
    nodes = np.ix_(rows, columns)
    height = surface.height[nodes] if parts == 1 and not margin else surface_heights(surface, x, y)
    return x, y, height, None if surface.material is None else surface.material[nodes]


def stride(surface: Surface) -> int:
    """Returns how many nodes of a surface one drawn node stands for, along each axis."""
    return max(int(np.ceil(np.sqrt(surface.height.size / MOST_NODES))), 1)


def material_legend(surface: Surface, parameters: Mapping[str, float]) -> list[dict[str, str]]:
    """Returns what each material from 1 on is drawn as, and its text for the legend."""
    if surface.materials is None:
        return []
    return [{"look": _look(row, parameters), "text": _describe(row)} for row in surface.materials]


def _look(row: NDArray[np.float64], parameters: Mapping[str, float]) -> str:
    if row[LAW] > 0.0:
        return SOIL
    return SLIPPERY if row[MU] < parameters.get("friction.mu", 0.0) else PATCH


def _describe(row: NDArray[np.float64]) -> str:
    """Returns the properties of a material that differ from the ground of the definition."""
    parts = ["soil"] if row[LAW] > 0.0 else []
    parts += [
        f"{key} {row[column]:.3g}{UNITS[key]}"
        for key, column in PROPERTIES.items()
        if np.isfinite(row[column])
    ]
    return ", ".join(parts)
