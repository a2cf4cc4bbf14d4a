"""Makes the job of a study: what all its workers need, which is sent to each of them once."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any
from uuid import uuid4

from hexapod_cosim.controller import DEFAULT_PERIOD, Gains
from hexapod_cosim.cosim.common.plant_files import code_hash, package_version
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.run.plan import chosen_gains, design_key, make_setup
from hexapod_cosim.cosim.run.plant import PlantFmus
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.controls import table_with_control
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.extensions.study.factors import samples
from hexapod_cosim.extensions.study.records import Study, StudyError
from hexapod_cosim.models import list_robots, load_robot

FORMAT = 2  # of a study's folder
PACKAGES = ("fmpy", "numpy", "scipy", "control")
DESIGN_FACTORS = ("robot", "macro_step", "servo.")  # a design of gains depends on these


@dataclass(frozen=True, kw_only=True)
class Job:
    """Everything that a worker needs except the orders."""

    name: str  # unique: studies share the workers of a cluster
    study: Study
    fmus: Mapping[str, bytes]  # plant FMUs by robot, as scenarios name it
    controller: bytes  # the controller FMU, whose parameters each run sets
    robots: Mapping[str, bytes]  # robot files that are not part of the package, by path
    laws: Mapping[str, bytes]  # files of the users' controls, by label
    gains: Gains | None  # of all compliant runs; None: workers design them
    environment: Mapping[str, str]  # versions, see environment()
    runner: type[Runner] = Runner  # gets the controller FMU as `controller`


def make_job(
    study: Study,
    *,
    fmu: Path | None = None,
    gains: Gains | None = None,
    runner: type[Runner] = Runner,
) -> Job:
    """Exports the FMUs and designs the gains that all runs share. Raises HexapodError.

    Args:
        fmu: the plant FMU of all runs; by default one is exported for each robot.
        gains: the gains of all compliant runs; by default they are designed.
    """
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
    files = {name: Path(name).read_bytes() for name in names if name not in list_robots()}
    with TemporaryFolder("study") as folder:
        plants = PlantFmus(folder, given=fmu)
        return Job(
            name=uuid4().hex,
            study=study,
            fmus={name: plants.fmu(name).read_bytes() for name in names},
            controller=_controller(folder),
            robots=files,
            laws=_laws(study),
            gains=gains or _common_gains(study),
            environment=environment(study),
            runner=runner,
        )


def _laws(study: Study) -> dict[str, bytes]:
    """Returns the files of the users' controls by label.

    Raises HexapodError when one cannot be read or does not take the parameters of [control].
    """
    controls = study.chosen_controls
    varied = {
        factor.name: factor.setting(samples(factor)[0])
        for factor in study.factors
        if factor.name.startswith("control.")
    }
    for case in study.cases.values():
        table = with_values(case.table, varied)
        check_control(scenario_from_table(table, where=case.where), controls)
    return {
        control.label: control.path.read_bytes() for control in controls if control.path is not None
    }


def _robots(study: Study) -> list[str]:
    """Returns the names of all robots of a study."""
    swept = [
        str(value) for factor in study.factors if factor.name == "robot" for value in factor.values
    ]
    own = [str(case.table.get("robot", "athena")) for case in study.cases.values()]
    return list(dict.fromkeys(swept or own))


def _controller(folder: Path) -> bytes:
    """Exports the controller FMU to a folder and returns its content."""
    setup = make_setup(load_robot(list_robots()[0]), control="kinematic", period=DEFAULT_PERIOD)
    return export_controller(setup, folder / "controller.fmu").read_bytes()


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


def environment(study: Study | None = None) -> dict[str, str]:
    """Returns the versions and the platform that results depend on beside the job, by name.

    They must be the same on every worker.
    """
    names = PACKAGES if study is None or study.optimise is None else (*PACKAGES, "optuna")
    return {
        "hexapod-cosim": package_version(),
        "code": code_hash(),
        "python": platform.python_version(),
        **{name: version(name) for name in names},
        "platform": f"{sys.platform} {platform.machine()}",
    }


def manifest_of(job: Job, *, runs: int) -> dict[str, Any]:
    """Returns the content of manifest.json, for a number of runs.

    It holds the study as its tables, the scenarios in full, seeds, versions, SHA-256 of the FMUs
    and robot files, and gains.
    """
    study, asked = job.study, job.study.optimise
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
        "fmus": _hashes(job.fmus),
        "controller": hashlib.sha256(job.controller).hexdigest(),
        "robots": _hashes(job.robots),
        "gains": None if job.gains is None else asdict(job.gains),
    } | ({"laws": _hashes(job.laws)} if job.laws else {})


def _hashes(contents: Mapping[str, bytes]) -> dict[str, str]:
    """Returns the SHA-256 of files by name."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
