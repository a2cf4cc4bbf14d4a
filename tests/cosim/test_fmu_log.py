"""Errors of each of several FMUs in one process carry the messages of that FMU."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from hexapod_cosim.cosim.master.fmu import Fmu, StepError

LONG = (1.5, 2.5)  # s    steps over the end


def test_each_fmu_reports_its_own_errors_alone_and_after_another_is_gone(athena_fmu: Path) -> None:
    with Fmu(athena_fmu) as first:
        with Fmu(athena_fmu) as second:
            for fmu, h in zip((first, second), LONG, strict=True):
                fmu.initialise(0.0, 1.0)
                with pytest.raises(StepError, match=f"got {h:g} s"):
                    fmu.step(0.0, h)
        gc.collect()
        with pytest.raises(StepError, match=r"got 1\.5 s"):
            first.step(0.0, LONG[0])
