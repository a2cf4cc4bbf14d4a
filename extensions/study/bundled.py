"""The studies that come with the package; imports nothing slow."""

from __future__ import annotations

from pathlib import Path

from hexapod_cosim.cosim.cli.extension import Rows


def list_studies() -> dict[str, Path]:
    """Returns the studies that come with the package, by name."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "studies").glob("*.toml"))}


def bundled_studies() -> Rows:
    """Returns what `hexapod list studies` shows."""
    from hexapod_cosim.cosim.cli.listing import titles  # noqa: PLC0415

    return titles(list_studies())
