"""The scenarios that come with this package."""

from __future__ import annotations

from pathlib import Path


def list_scenarios() -> dict[str, Path]:
    """Returns the bundled scenarios by name."""
    found = {path.stem: path for path in (Path(__file__).parent / "scenarios").rglob("*.toml")}
    return dict(sorted(found.items()))
