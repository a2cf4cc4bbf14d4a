"""Names of the FMU variables of all legs, joints and feet, in the order of the legs."""

from __future__ import annotations

from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

LEGS, JOINTS = len(LEG_NAMES), len(JOINT_NAMES)
AXES = (1, 2, 3)


def joint_names(quantity: str) -> list[str]:
    """Returns the names of a quantity of all joints; legs run slowest."""
    return [f"{leg}.{joint}.{quantity}" for leg in LEG_NAMES for joint in JOINT_NAMES]


def foot_names(quantity: str) -> list[str]:
    """Returns the names of a scalar quantity of all feet."""
    return [f"{leg}.foot.{quantity}" for leg in LEG_NAMES]


def vector_names(stem: str, size: int = 3) -> list[str]:
    """Returns the names of a vector's elements."""
    return [f"{stem}[{k}]" for k in range(1, size + 1)]


def foot_vector_names(quantity: str) -> list[str]:
    """Returns the names of a vector quantity of all feet; axes run fastest."""
    return [name for stem in foot_names(quantity) for name in vector_names(stem)]
