"""Imports the packages of the extra `logs`, or says how to install them."""

from __future__ import annotations

from pathlib import Path

from hexapod_cosim.cosim.common.installation import require_packages

EXTRA, PACKAGES = "logs", ("mcap", "mcap_ros2")


def require_mcap(where: str | Path) -> None:
    """Raises HexapodError, which names the extra, unless MCAP files can be written and read."""
    require_packages(PACKAGES, "MCAP", extra=EXTRA, where=where)
