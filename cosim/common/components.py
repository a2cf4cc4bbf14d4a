"""The components that FMUs exist for: the plant, its controller and learned policies.

All use the FMI layer in fmi/ and describe their variables in an interface.toml.
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
    tree="controller_fmu",
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
POLICY = Component(
    name="policy",
    identifier="hexapod_policy",
    tree="policy_fmu",
    installed="plant/policy",
    header="hexapod/policy.h",
    prefix="policy_",
    structure="Policy",
    suffix="_policy",
    description=(
        "Learned policy of a hexapod robot: angles of its {joints} joints from a body velocity and "
        "from measurements by a multilayer perceptron"
    ),
)
