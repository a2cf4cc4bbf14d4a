"""Imports the packages of the extra `logs`, or says how to install them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.models import HexapodError

EXTRA, PACKAGES = "logs", ("mcap", "mcap_ros2")


def require_mcap(where: str | Path) -> None:
    """Raises HexapodError, which names the extra, unless MCAP files can be written and read."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        raise HexapodError(
            "MCAP files need packages that are not installed",
            got=f"no {missing[0]}",
            expected="mcap and mcap-ros2-support",
            fix=install_extra(EXTRA),
            where=str(where),
        )
