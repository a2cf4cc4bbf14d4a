"""Tests what .ci/run needs and installs: a Python with venv of a version that is read, and pinned
versions of every package, with the hashes of their files.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN, CONSTRAINTS = ROOT / ".ci" / "run", ROOT / ".ci" / "constraints.txt"
LOCK = ROOT / ".ci" / "requirements.txt"
TOOLS = ("make", "cc", "g++", "clang", "pkg-config", "musl-gcc", "git", "chromium")
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


def said(folder: Path, python: str) -> tuple[int, str]:
    """Runs .ci/run with stubs of all tools and this Python; returns exit code and stderr."""
    bash, dirname = shutil.which("bash"), shutil.which("dirname")
    assert bash is not None
    assert dirname is not None
    for name, text in {**dict.fromkeys(TOOLS, "exit 0"), "python": python}.items():
        (folder / name).write_text(f"#!{bash}\n{text}\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    (folder / "dirname").symlink_to(dirname)
    (folder / "id").symlink_to(shutil.which("id") or "/usr/bin/id")
    done = subprocess.run(
        [bash, str(RUN)],
        env={"PATH": str(folder), "PYTHON": str(folder / "python"), "HOME": os.environ["HOME"]},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stderr


OLD = 'case "$*" in *version_info*) exit 1;; --version) echo "Python 3.9.2";; esac; exit 0'
NO_VENV = 'case "$*" in *venv*) exit 1;; --version) echo "Python 3.11.2";; esac; exit 0'


@pytest.mark.parametrize(
    ("python", "message"),
    [
        (OLD, "got Python 3.9.2, expected Python 3.11 or"),
        (NO_VENV, "missing: python3 python3-venv"),
    ],
)
def test_an_unusable_python_is_told_before_anything_runs(
    tmp_path: Path, python: str, message: str
) -> None:
    code, text = said(tmp_path, python)
    assert code == 1
    assert message in text


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


def locked() -> dict[str, tuple[str, list[str]]]:
    """Returns version and hashes of each package of the lock file by its normal name."""
    text = LOCK.read_text(encoding="utf-8").partition("\n")[2]
    entries = re.split(r"\n(?=\w)", text.replace(" \\\n", " "))
    found = {}
    for entry in entries:
        words = entry.split()
        name, _, version = words[0].partition("==")
        found[normal(name)] = version, words[1:]
    return found


def test_the_lock_file_has_hashes_of_every_package_and_names_no_server() -> None:
    packages = locked()
    assert len(packages) > 150
    for name, (version, hashes) in packages.items():
        assert re.fullmatch(r"[\w.+!-]+", version), name
        assert hashes, name
        assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", one) for one in hashes), name
    text = LOCK.read_text(encoding="utf-8")
    assert "://" not in text
    assert "hexapod" not in text


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
