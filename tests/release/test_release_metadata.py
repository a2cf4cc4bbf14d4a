"""Tests that files for other indexes and archives say what pyproject.toml says, and that the
licences travel with everything that contains software.
"""

from __future__ import annotations

import importlib.util
import json
import re
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import load_robot

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
RENAMED = {"matplotlib": "matplotlib-base"}  # conda-forge's package without a window system


def read_yaml(path: str) -> Any:
    """Reads a YAML file of the repository."""
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_versions_are_the_project_s() -> None:
    recipe = read_yaml("packaging/conda/recipe.yaml")
    assert recipe["context"]["version"] == PROJECT["version"]
    assert read_yaml("CITATION.cff")["version"] == PROJECT["version"]


def test_the_conda_recipe_requires_what_the_wheel_requires() -> None:
    wanted = {re.split(r"(?=>)", item, maxsplit=1)[0]: item for item in PROJECT["dependencies"]}
    run = read_yaml("packaging/conda/recipe.yaml")["requirements"]["run"]
    assert {item.replace(" ", "") for item in run[1:]} == {
        item.replace(name, RENAMED.get(name, name), 1) for name, item in wanted.items()
    }
    assert run[0] == f"python {PROJECT['requires-python']}"


def test_the_release_workflow_runs_targets_that_exist_and_publishes_nothing() -> None:
    (job,) = read_yaml(".github/workflows/release.yml")["jobs"].values()
    commands = " ".join(step.get("run", "") for step in job["steps"])
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"make ([\w-]+)", commands):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    used = {step["uses"].partition("@")[0] for step in job["steps"] if "uses" in step}
    assert used == {"actions/checkout", "actions/setup-python", "actions/upload-artifact"}
    assert "upload " not in commands
    assert "publish" not in commands


# What others must know of licences travels with everything that holds software: the report's
# viewer, the wheel, every FMU.

PACKAGES = ROOT / "cosim" / "viewer" / "node_modules"
OURS = "Copyright (c) 2026 The hexapod-cosim developers"
PERMISSION = "Permission is hereby granted, free of charge, to any person obtaining a copy"


def build_viewer() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "build_viewer", ROOT / "tools" / "build_viewer.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def licences() -> dict[str, str]:
    """Texts by package of all that esbuild says it took code from; the bundle is made anew if
    its sources have changed.
    """
    tool = build_viewer()
    tool.bundle()
    tool.install_packages(all_of_them=False)
    inputs = json.loads((ROOT / "build" / "viewer" / "metafile.json").read_text(encoding="utf-8"))[
        "inputs"
    ]
    foreign = [path for path in inputs if "node_modules/" in path]
    names = {re.findall(r"node_modules/((?:@[^/]+/)?[^/]+)/", path)[-1] for path in foreign}
    return {
        name: (PACKAGES / name / "LICENSE").read_text(encoding="utf-8").strip() for name in names
    }


def test_the_bundle_begins_with_every_licence(licences: dict[str, str]) -> None:
    bundle = (ROOT / "build" / "viewer" / "viewer.js").read_text(encoding="utf-8")
    head = bundle.partition("*/")[0]
    assert head.startswith("/*!")
    assert all(text in head for text in [OURS, *licences.values()])


def test_the_installed_wheel_holds_every_licence(licences: dict[str, str]) -> None:
    files = {str(path): path for path in metadata.files("hexapod-cosim") or []}
    viewer, text = (
        files[f"hexapod_cosim/plant/viewer/{name}"].read_text()
        for name in ("viewer.js", "LICENSES.txt")
    )
    for licence in [OURS, *licences.values()]:
        assert licence in viewer, "run make setup"
        assert licence in text
    assert "hexapod_cosim/plant/LICENSE" in files
    assert (
        OURS
        in next(
            path for name, path in files.items() if name.endswith(".dist-info/licenses/LICENSE")
        ).read_text()
    )


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("platforms", [None, ["sources"]], ids=["binary", "sources alone"])
def test_an_fmu_holds_the_projects_licence(
    plant_build: Path, tmp_path: Path, fmi: int, platforms: list[str] | None
) -> None:
    robot = load_robot("athena")
    plant = export_fmu(robot, tmp_path / "plant.fmu", fmi=fmi, platforms=platforms)
    setup = make_setup(robot, control="kinematic", period=0.005)
    controller = export_controller(setup, tmp_path / "controller.fmu", fmi=fmi, platforms=platforms)
    for path in (plant, controller):
        with zipfile.ZipFile(path) as archive:
            assert any(name.startswith("sources/src/") for name in archive.namelist())
            text = archive.read("documentation/licenses/license.txt").decode()
        assert OURS in text
        assert PERMISSION in text
