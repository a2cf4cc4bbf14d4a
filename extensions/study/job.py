"""Makes the job of a study: what its workers need beside the orders, and the manifest."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any
from uuid import uuid4

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT
from hexapod_cosim.cosim.common.plant_files import binary, code_hash, fmi2_platform, package_version
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.run.plan import chosen_gains, design_key
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.controls import table_with_control
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.rules import require
from hexapod_cosim.models import list_robots

FORMAT = 3  # of a study's folder
PACKAGES = ("fmpy", "numpy", "scipy", "control")
DESIGN_FACTORS = ("robot", "macro_step", "servo.")  # a design of gains depends on these


@dataclass(frozen=True, kw_only=True)
class Job:
    """Everything that a worker needs except the orders; it is sent with each chunk of them."""

    name: str  # unique: studies share the workers of a cluster
    study: Study  # without the values of its factors, which orders have
    fmu: Path | None  # the plant FMU of all runs; None: each worker exports that of each robot
    gains: Gains | None  # of all compliant runs; None: workers design them
    files: tuple[str, ...]  # robots, controls and FMU that results depend on
    environment: Mapping[str, str]  # see environment()
    runner: type[Runner] = Runner  # gets the plant FMU as `fmu`


def make_job(
    study: Study,
    *,
    fmu: Path | None = None,
    gains: Gains | None = None,
    runner: type[Runner] = Runner,
) -> Job:
    """Returns the job of a study, with gains that all runs share. Raises HexapodError.

    Args:
        fmu: the plant FMU of all runs; by default one is exported for each robot.
        gains: the gains of all compliant runs; by default they are designed.
    """
    names = _robots(study)
    what, fix = "one FMU for several robots", "leave --fmu out: each robot's is exported"
    single = fmu is None or len(names) == 1
    require(single, ", ".join(names), "a single robot", "--fmu", what=what, fix=fix)
    for case in study.cases.values():  # a control takes the parameters of [control], or is refused
        check_control(scenario_from_table(case.table, where=case.where), study.laws)
    robots = [name for name in names if name not in list_robots()]
    laws = [control.path for control in study.laws]
    factors = tuple(replace(factor, values=()) for factor in study.factors)
    files = tuple(str(path.resolve()) for path in (*map(Path, robots), *laws, fmu) if path)
    return Job(
        name=uuid4().hex,
        study=replace(study, factors=factors, source={}),
        fmu=fmu if fmu is None else fmu.resolve(),
        gains=gains or _common_gains(study),
        files=files,
        environment=environment(files),
        runner=runner,
    )


def _robots(study: Study) -> list[str]:
    """Returns the names of all robots of a study."""
    swept = [
        str(value) for factor in study.factors if factor.name == "robot" for value in factor.values
    ]
    own = [str(case.table.get("robot", "athena")) for case in study.cases.values()]
    return list(dict.fromkeys(swept or own))


def _common_gains(study: Study) -> Gains | None:
    """Designs gains when all compliant runs share one set; returns None otherwise."""
    text = study.gains_text
    if text is None:
        return None
    scenarios = [
        scenario_from_table(table_with_control(case.table, text), where=case.where)
        for case in study.cases.values()
    ]
    varied = any(factor.name.startswith(DESIGN_FACTORS) for factor in study.factors)
    if varied or len(set(map(design_key, scenarios))) > 1:
        return None
    return chosen_gains(scenarios[0])


def environment(files: Iterable[str]) -> dict[str, str]:
    """Returns what results depend on beside the job: versions, and the SHA-256 of some files.

    It must be the same on every worker, where the files lie at the same path.
    """
    binaries = {part.name: binary(fmi2_platform(), part) for part in (PLANT, CONTROLLER)}
    paths = binaries | {file: Path(file) for file in files}
    return {
        "hexapod-cosim": package_version(),
        "code": code_hash(),
        "python": platform.python_version(),
        **{name: version(name) for name in PACKAGES},
        "platform": f"{sys.platform} {platform.machine()}",
        **{
            name: hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
            for name, path in paths.items()
        },
    }


def manifest_of(study: Study, job: Job, *, runs: int) -> dict[str, Any]:
    """Returns the content of manifest.json, for a number of runs.

    It holds the study as its tables, the scenarios in full, seeds, versions, SHA-256 of files, and
    gains.
    """
    asked = study.optimise
    return {
        "format": FORMAT,
        "title": study.title,
        "study": study.source,
        "runs": runs,
        "seeds": [study.seeds[0], study.seeds[-1], len(study.seeds)]
        if asked is None
        else {"training": list(asked.training.seeds), "held_out": list(asked.held_out.seeds)},
        "scenarios": {name: case.table for name, case in study.cases.items()},
        "environment": job.environment,
        "gains": None if job.gains is None else asdict(job.gains),
    }
