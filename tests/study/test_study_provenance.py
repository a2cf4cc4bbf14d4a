"""The metadata of result files say what made them, whoever ran it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from gains import make_gains
from studies import run_quietly, study_of

from hexapod_cosim.extensions.study.folder import RESULTS
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.models import load_robot

TABLE: dict[str, Any] = {
    "title": "Größe",
    "seeds": [3, 8],
    "factors": {"friction.mu": [0.3, 0.6], "scenario": ["walk_flat", "turn"]},
}


def read_facts(path: Path) -> dict[str, str]:
    found = pq.read_metadata(path).metadata
    return {
        name.decode().removeprefix("hexapod."): text.decode()
        for name, text in found.items()
        if name.startswith(b"hexapod.")
    }


def test_a_file_by_itself_holds_the_study_its_scenarios_seeds_versions_and_gains(
    athena_fmu: Path, tmp_path: Path
) -> None:
    study, gains = study_of(TABLE), make_gains(load_robot("athena"))
    run_quietly(study, tmp_path / "out", fmu=athena_fmu, gains=gains)
    facts = read_facts(tmp_path / "out" / RESULTS)
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
    assert json.loads(facts["fmus"]) == {
        "athena": hashlib.sha256(athena_fmu.read_bytes()).hexdigest()
    }
    assert json.loads(facts["environment"])["numpy"] == np.__version__
    hold = asdict(gains)["hold"]
    assert json.loads(facts["gains"])["hold"] == hold
    assert facts["gains_sha256"] == hashlib.sha256(facts["gains"].encode()).hexdigest()
