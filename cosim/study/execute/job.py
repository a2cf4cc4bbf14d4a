"""What workers need, made once and sent to each as it is: scenarios, FMUs and robot files as
bytes, gains, how figures are made.
"""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import uuid4

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.plant_files import code_hash, package_version
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.cosim.run.run import chosen_gains, known_robot
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.study.execute.engines import engine_named
from hexapod_cosim.cosim.study.plan.records import Case, Factor, Study, StudyError
from hexapod_cosim.cosim.study.store.manifest import FORMAT
from hexapod_cosim.models import HexapodError, list_robots, load_robot

CONTROLLER_PERIOD = 0.005  # s    of the FMU as packed, like all its parameters; a run has its own
PACKAGES = ("fmpy", "numpy", "scipy", "control", "pyarrow")
OF_DESIGN = ("robot", "macro_step", "servo.")  # factors that gains are designed anew for


@dataclass(frozen=True, kw_only=True)
class Job:
    """Everything but the orders."""

    name: str  # unlike any other's: studies share a cluster's workers

    cases: Mapping[str, Case]
    factors: tuple[Factor, ...]
    fmus: Mapping[str, bytes]  # by robot, as scenarios name it
    controller: bytes  # an FMU whose parameters each run sets
    robots: Mapping[str, bytes]  # files of robots that do not come with the package, by their path
    gains: (
        Gains | None
    )  # of all compliant runs; None: designed by the worker, for each robot and macro-step
    engine: str
    environment: Mapping[str, str]


def make_job(
    study: Study, *, engine: str, fmu: Path | None = None, gains: Gains | None = None
) -> Job:
    """Exports the FMUs and designs the gains that all runs share. Raises HexapodError.

    Args:
        engine: name of the way figures are made.
        fmu: of all runs; by default one is exported for each robot.
        gains: of all compliant runs; by default designed.
    """
    engine_named(engine)  # not first in a worker
    names = _robots(study)
    if fmu is not None and len(names) > 1:
        fix = "leave --fmu out: each robot's is exported; or split the study by robots"
        raise StudyError(
            "one FMU for several robots",
            got=", ".join(names),
            expected="a single robot",
            fix=fix,
            where="--fmu",
        )
    fmus = {name: _fmu(name) if fmu is None else _bytes(fmu) for name in names}
    files = {name: _bytes(Path(name)) for name in names if name not in list_robots()}
    return Job(
        name=uuid4().hex,
        cases=study.cases,
        factors=study.factors,
        fmus=fmus,
        controller=_controller(),
        robots=files,
        gains=_gains(study, gains),
        engine=engine,
        environment=environment(study),
    )


def _robots(study: Study) -> list[str]:
    """All that its scenarios name."""
    swept = [
        str(value) for factor in study.factors if factor.name == "robot" for value in factor.values
    ]
    own = [str(case.table.get("robot", "athena")) for case in study.cases.values()]
    return list(dict.fromkeys(swept or own))


def _fmu(robot: str) -> bytes:
    with TemporaryDirectory(prefix="hexapod-study-") as folder:
        return export_fmu(load_robot(robot), Path(folder) / "robot.fmu").read_bytes()


def _controller() -> bytes:
    setup = make_setup(load_robot(list_robots()[0]), control="kinematic", period=CONTROLLER_PERIOD)
    with TemporaryDirectory(prefix="hexapod-study-") as folder:
        return export_controller(setup, Path(folder) / "controller.fmu").read_bytes()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise HexapodError(
            "cannot read", got=error.strerror, expected="a file", where=str(path)
        ) from error


def _gains(study: Study, given: Gains | None) -> Gains | None:
    """Designed here when one set does for all runs."""
    if "compliant" not in study.run_controls or given is not None:
        return given
    plans = [
        scenario_from_table({**case.table, "control": "compliant"}, where=case.where)
        for case in study.cases.values()
    ]
    kinds = {(known_robot(plan).hash, plan.macro_step) for plan in plans}
    if len(kinds) > 1 or any(factor.name.startswith(OF_DESIGN) for factor in study.factors):
        return None
    return chosen_gains(plans[0])


def environment(study: Study | None = None) -> dict[str, str]:
    """What figures may depend on beside the job: every worker's must be the same."""
    names = PACKAGES if study is None or study.optimise is None else (*PACKAGES, "optuna")
    return {
        "hexapod-cosim": package_version(),
        "code": code_hash(),
        "python": platform.python_version(),
        **{name: version(name) for name in names},
        "platform": f"{sys.platform} {platform.machine()}",
    }


def manifest_of(study: Study, job: Job, *, runs: int) -> dict[str, Any]:
    """The study as its tables, the scenarios in full, seeds, versions, hashes of the FMUs,
    gains.
    """
    return {
        "format": FORMAT,
        "title": study.title,
        "study": study.source,
        "runs": runs,
        "seeds": [study.seeds[0], study.seeds[-1], len(study.seeds)]
        if study.optimise is None
        else _judged(study),
        "scenarios": {name: case.table for name, case in study.cases.items()},
        "engine": job.engine,
        "environment": job.environment,
        "fmus": {name: hashlib.sha256(content).hexdigest() for name, content in job.fmus.items()},
        "controller": hashlib.sha256(job.controller).hexdigest(),
        "robots": {
            name: hashlib.sha256(content).hexdigest() for name, content in job.robots.items()
        },
        "gains": None if job.gains is None else asdict(job.gains),
    }


def _judged(study: Study) -> dict[str, list[int]]:
    assert study.optimise is not None
    return {
        "training": list(study.optimise.training.seeds),
        "held_out": list(study.optimise.held_out.seeds),
    }
