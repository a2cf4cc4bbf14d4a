"""The studies that come with the package; imports nothing, because every command needs it."""

from __future__ import annotations

from pathlib import Path


def list_studies() -> dict[str, Path]:
    """Returns the studies that come with the package, by name."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "studies").glob("*.toml"))}
