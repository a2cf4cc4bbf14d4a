"""Tests what .ci/run needs and installs: a Python with venv of a version that is read, and pinned
versions of every package, with the hashes of their files.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUN, CONSTRAINTS = ROOT / ".ci" / "run", ROOT / ".ci" / "constraints.txt"
NAME = re.compile(r"[A-Za-z0-9._-]+")
OWN = {"hexapod_cosim", "benchmarks", "tools", ""}  # modules of this repository; "" is relative
PACKAGES = {  # of modules that are not named as their package
    "PIL": "pillow",
    "mcap_ros2": "mcap-ros2-support",
    "pinocchio": "pin",
    "xdist": "pytest-xdist",
    "yaml": "pyyaml",
}


def normal(name: str) -> str:
    """Returns a package's name as package indices compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_dependency_is_pinned_in_a_version() -> None:
    lines = [
        line
        for line in CONSTRAINTS.read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    ]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.+!-]+", line)] == []
    pinned = {normal(line.partition("==")[0]) for line in lines}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {normal(match[0]) for text in needed if (match := NAME.match(text))}
    assert names - pinned - {"hexapod-cosim"} == set()


def test_the_extra_for_tests_names_every_package_that_the_tests_import() -> None:
    files = sorted((ROOT / "tests").rglob("*.py"))
    known = OWN | {path.stem for path in files} | set(sys.stdlib_module_names)
    used = {name for path in files for name in modules(path)} - known
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    given = [*project["dependencies"], *extras["test"], *extras["studies"], *extras["parquet"]]
    named = {normal(match[0]) for text in given if (match := NAME.match(text))}
    assert "hexapod-cosim[parquet,studies]" in extras["test"]
    assert {normal(PACKAGES.get(name, name)) for name in used} - named == set()


def modules(path: Path) -> set[str]:
    """Returns the first names of the modules that a file imports, wherever in it."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = [one.name for node in nodes if isinstance(node, ast.Import) for one in node.names]
    names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}
