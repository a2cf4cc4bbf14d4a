"""A walking hexapod as an FMU, its controllers, and their co-simulation.

`simulate` runs a scenario under any controller; `report` writes the report of one or several runs.
"""

from __future__ import annotations

from os.path import dirname
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hexapod_cosim.cosim.api import report, simulate

__all__ = ["report", "simulate"]
# as in the wheel; an editable installation lists the root here, and so its tests and tools, too
__path__ = [dirname(__file__)]


def __getattr__(name: str) -> Any:
    """Imports the public calls when they are first asked for: their imports take a second."""
    if name in __all__:
        from hexapod_cosim.cosim import api  # noqa: PLC0415

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
