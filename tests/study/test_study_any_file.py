"""Any study file is read or refused with a reason: files with seeded random changes."""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import pytest
import tomlkit
from studies import study_of

from hexapod_cosim.cosim.common.files import to_json
from hexapod_cosim.extensions.study.extension import list_studies
from hexapod_cosim.extensions.study.orders import count_runs, sweep_orders
from hexapod_cosim.extensions.study.reading import load_study, study_from_table
from hexapod_cosim.extensions.study.store import columns_of
from hexapod_cosim.models import HexapodError

SEEDS, FILES = 2, 60  # files per seed, of which one in fourteen is a study
CHANGES = 3  # to a file, at most
NAN, INF = float("nan"), float("inf")
# fmt: off
ODD: list[Any] = [
    0, -1, 2, 10**20, 2**63, 0.0, 1e308, -1e308, 5e-324, NAN, INF, True, False, "", "a\0b",
    "é" * 300, "walk_flat", "ripple", ".", "..", "3 kg", "5 deg", [], {}, [[]], {"": 1}, [1, "1"],
    [1, 1.0, True], {"uniform": [0, 1]}, {"uniform": [1, 0]}, {"uniform": ["a", "b"]},
    {"loguniform": [1e-300, 1e300]}, {"integers": [0, 1e300]}, {"linspace": [0, 1, 1e7]},
    {"logspace": [-1, 1, 3]}, {"values": [1, 2], "relative": True}, {"first": -1},
    {"first": 3, "count": 10**9}, {"at_most": "low"}, ["kinematic"], ["walk_flat", "walk_flat"],
    {"time": 1},
]
NAMES = [
    "", ".", "a.b", "friction.mu", "friction", "mu", "gains.hold.path_rate", "gains.",
    "gains.hold", "gains.margins.binding", "parameters", "parameters.torso.mass", "torso.mass",
    "scenario", "robot", "seed", "control", "command.vx", "command", "gait.name", "variation",
    "variation.height", "outputs", "outputs.csv", "terrain.incline", "duration", "macro_step",
    "solver.method", "events", "set", "factors", "optimise", "training", "held_out", "scenarios",
    "seeds", "values", "uniform", "unit", "relative", "title", "design", "points",
]
# fmt: on
BEGUN: list[dict[str, Any]] = [
    {"seeds": 2, "factors": {"friction": {"mu": [0.3, 0.6]}, "gait.name": ["tripod", "wave"]}},
    {
        "design": "sobol",
        "points": 4,
        "set": {"duration": 2.0, "torso": {"mass": 2.5}},
        "factors": {
            "friction.mu": {"uniform": [0.3, 0.9]},
            "gains.hold.path_rate": {"loguniform": [0.5, 2.0], "relative": True},
        },
    },
    {
        "scenario": {"robot": "athena", "command": {"vx": 0.05}, "events": []},
        "design": "list",
        "factors": {"terrain.incline": [0.0, 0.1]},
    },
    {"factors": {"scenario": ["walk_flat", "turn"]}, "controls": ["kinematic"]},
]


def places(table: Any) -> list[tuple[Any, Any]]:
    """Returns every container in a table with each of its keys."""
    if isinstance(table, dict):
        return [(table, key) for key in table] + [
            pair for value in table.values() for pair in places(value)
        ]
    if isinstance(table, list):
        return [(table, k) for k in range(len(table))] + [
            pair for value in table for pair in places(value)
        ]
    return []


def changed(table: Mapping[str, Any], draw: random.Random) -> dict[str, Any]:
    """Returns a copy in which entries are replaced, renamed, added or removed."""
    found = deepcopy(dict(table))
    for _ in range(draw.randint(1, CHANGES)):
        container, key = draw.choice(places(found) or [(found, "title")])
        what = draw.randrange(4)
        if what == 0 and isinstance(container, dict):
            container[draw.choice(NAMES)] = deepcopy(draw.choice(ODD))
        elif what == 1 and isinstance(container, dict) and key in container:
            container[draw.choice(NAMES)] = container.pop(key)
        elif what == 2 and isinstance(container, dict):
            container.pop(key, None)
        else:
            container[key] = deepcopy(draw.choice(ODD))
    return found


@pytest.mark.parametrize("seed", range(SEEDS))
def test_a_file_changed_at_random_is_a_study_or_refused_with_a_reason(seed: int) -> None:
    draw = random.Random(seed)
    begun = [*BEGUN, *(dict(load_study(name).source) for name in list_studies())]
    for _ in range(FILES):
        table = changed(draw.choice(begun), draw)
        try:
            study = study_of(table)
        except HexapodError:
            continue
        columns_of(study)
        source = json.loads(to_json(study.source))  # as a folder keeps it
        assert tomllib.loads(tomlkit.dumps(source)) == source
        again = study_from_table(
            source,
            where="manifest.json",
            scenarios={name: case.table for name, case in study.cases.items()},
        )
        assert (again.factors, again.optimise, list(again.seeds)[:3]) == (
            study.factors,
            study.optimise,
            list(study.seeds)[:3],
        )
        if study.optimise is None:
            assert len(list(sweep_orders(study, [0, count_runs(study) - 1]))) == 2
