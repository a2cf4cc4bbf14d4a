"""Changes what an FMU's model description offers, for binaries that have less."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hexapod_cosim.cosim.interface.plant import Interface

# in a binary that a compiler without complex numbers built (plant_fmu/src/plant/continuous.c)
NO_DERIVATIVES = b"derivatives: got a call in a binary without complex numbers"


def for_binaries(interface: Interface, binaries: Mapping[str, bytes]) -> Interface:
    """Returns the interface that all of these binaries have: without directional derivatives if
    one was built by a compiler without complex numbers, such as Microsoft's.
    """
    lacking = any(NO_DERIVATIVES in data for data in binaries.values())
    return replace(interface, directional_derivatives=False) if lacking else interface
