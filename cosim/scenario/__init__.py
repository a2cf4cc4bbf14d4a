"""Scenarios: what is run, read from TOML files and checked.

Imports `common` and `interface`.
"""

from __future__ import annotations

from pathlib import Path


def list_scenarios() -> dict[str, Path]:
    """Returns the scenarios that come with this package by name."""
    found = {path.stem: path for path in (Path(__file__).parent / "scenarios").rglob("*.toml")}
    return dict(sorted(found.items()))
