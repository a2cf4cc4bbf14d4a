"""Exports a policy as a controller FMU."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hexapod_cosim.cosim.export.plant_export import export_interface
from hexapod_cosim.extensions.gym.interface import load_policy_interface
from hexapod_cosim.extensions.gym.policy import Policy
from hexapod_cosim.models import Robot


def export_policy(
    policy: Policy,
    robot: Robot,
    path: str | Path,
    *,
    fmi: int = 2,
    platforms: Iterable[str] | None = None,
) -> Path:
    """Writes a policy's FMU and returns its path; arguments and errors as `export_fmu`."""
    return export_interface(
        load_policy_interface(policy, robot), path, fmi=fmi, platforms=platforms
    )
