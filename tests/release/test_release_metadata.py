"""Files for other indexes and archives say what pyproject.toml says."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import yaml

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
