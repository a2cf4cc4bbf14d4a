"""A short soak: a minute of walking under random commands, pushes, faults and a repeated piece."""

from __future__ import annotations

from pathlib import Path

from tools.soak import soak


def test_a_minute_of_walking_drifts_and_grows_no_more_than_stated(plant_build: Path) -> None:
    figures = soak(60.0, seed=1)
    assert figures.failures == []
    assert figures.simulated == 60.0
    assert figures.repeated == 1
    assert figures.pushes > 0
    assert figures.faults > 0
