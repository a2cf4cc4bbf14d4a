"""What there are FMUs of: the plant and its controller. Both live behind one FMI layer and are
described in one form of interface.toml.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Component:
    """Where a component's files are, and what its C calls things."""

    name: str  # for messages
    identifier: str  # FMI's model identifier, and the name of the binary
    tree: str  # its folder in a source tree
    installed: str  # and in an installed package
    header: str  # of its C API
    prefix: str  # of its functions hx_{prefix}definition_default and so on
    structure: str  # of its C structures hx{structure}Definition, Input, Output
    suffix: str  # of the model's name after the robot's
    description: str  # of the model; {bodies} and {joints} are the robot's


PLANT = Component(
    name="plant",
    identifier="hexapod",
    tree="plant_fmu",
    installed="plant",
    header="hexapod/hexapod.h",
    prefix="",
    structure="",
    suffix="",
    description="Hexapod robot of {bodies} rigid bodies and {joints} servo joints, walking on compliant ground",
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
    description="Walking controller of a hexapod robot: commands of its {joints} joints from a body velocity and from foot forces",
)
