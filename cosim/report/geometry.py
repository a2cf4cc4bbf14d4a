"""Describes the robot and the ground of a run for the viewer, from the FMU's parameters."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hexapod_cosim.cosim.export.picture import COLOURS, THICKNESS
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.window import FLAT, SLOPE
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, HexapodError, load_robot
from hexapod_cosim.models.schema import parse_toml

Parameters = Mapping[str, float]

FLATNESS = 0.25  # height of a torso of unknown size, relative to the width between its hips


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
