"""The metadata of result files say what made them, whoever ran it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from gains import make_gains
from studies import run_quietly, study_of

from hexapod_cosim.extensions.study.folder import RESULTS
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.summary import POINTS, read_results
from hexapod_cosim.models import load_robot

TABLE: dict[str, Any] = {
    "title": "Größe",
    "seeds": [3, 8],
    "factors": {"friction.mu": [0.3, 0.6], "scenario": ["walk_flat", "turn"]},
}


@pytest.fixture
def facts(athena_fmu: Path, tmp_path: Path) -> Mapping[str, str]:
    """Returns the metadata of a small study's results, by name; its folder is `out`."""
    run_quietly(
        study_of(TABLE), tmp_path / "out", fmu=athena_fmu, gains=make_gains(load_robot("athena"))
    )
    return read_facts(tmp_path / "out" / RESULTS)


def read_facts(path: Path) -> dict[str, str]:
    found = pq.read_metadata(path).metadata
    return {
        name.decode().removeprefix("hexapod."): text.decode()
        for name, text in found.items()
        if name.startswith(b"hexapod.")
    }


def test_a_file_by_itself_holds_the_study_its_scenarios_and_seeds(facts: Mapping[str, str]) -> None:
    study = study_of(TABLE)
    again = study_from_table(
        json.loads(facts["study"]),
        where="results.parquet",
        scenarios=json.loads(facts["scenarios"]),
    )
    assert (again.factors, list(again.seeds), again.controls, again.title) == (
        study.factors,
        [3, 8],
        study.controls,
        "Größe",
    )
    assert {name: case.table for name, case in again.cases.items()} == {
        name: case.table for name, case in study.cases.items()
    }
    assert (json.loads(facts["seeds"]), facts["runs"]) == ([3, 8, 2], "16")


def test_a_file_by_itself_names_versions_fmus_and_gains(
    facts: Mapping[str, str], athena_fmu: Path
) -> None:
    assert json.loads(facts["fmus"]) == {
        "athena": hashlib.sha256(athena_fmu.read_bytes()).hexdigest()
    }
    assert len(facts["controller"]) == 64
    assert json.loads(facts["environment"])["numpy"] == version("numpy") == np.__version__
    hold = asdict(make_gains(load_robot("athena")))["hold"]
    assert json.loads(facts["gains"])["hold"] == hold
    assert facts["gains_sha256"] == hashlib.sha256(facts["gains"].encode()).hexdigest()


def test_the_table_of_points_says_the_same_of_itself(
    facts: Mapping[str, str], tmp_path: Path
) -> None:
    read_results(tmp_path / "out")
    assert read_facts(tmp_path / "out" / POINTS) == facts
