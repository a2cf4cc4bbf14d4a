"""The components that FMUs exist for: the plant and its controller.

They use the FMI layer in fmi/ and describe their variables in an interface.toml.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Component:
    """Locations of a component's files, and names in its C code."""

    name: str  # in messages
    identifier: str  # FMI's model identifier, and the name of the binary
    tree: str  # the folder in a source tree
    installed: str  # the folder in an installed package
    header: str  # of the C API
    prefix: str  # of C functions: hx_{prefix}definition_default
    structure: str  # in names of C structures: hx{structure}Definition
    suffix: str  # of the model's name, after the robot's
    description: str  # of the model, with the robot's {bodies} and {joints}


PLANT = Component(
    name="plant",
    identifier="hexapod",
    tree="plant_fmu",
    installed="plant",
    header="hexapod/hexapod.h",
    prefix="",
    structure="",
    suffix="",
    description=(
        "Hexapod robot of {bodies} rigid bodies and {joints} servo joints, walking on compliant "
        "ground"
    ),
)
CONTROLLER = Component(
    name="controller",
    identifier="hexapod_controller",
    tree="controller/fmu",
    installed="plant/controller",
    header="hexapod/controller.h",
    prefix="controller_",
    structure="Controller",
    suffix="_controller",
    description=(
        "Walking controller of a hexapod robot: commands of its {joints} joints from a body "
        "velocity and from foot forces"
    ),
)
