"""Each extension can be deleted: the core then installs, passes its tests and shows fewer commands.

`HEXAPOD_EXTENSIONS=all` (make test-extensions) installs each shorter tree in an environment of its
own and runs all of its tests, which takes as many times as long as the whole suite; `short` does so
for the tree without any extension, with the tests of the command line and of the documentation.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from pages import COMMANDS, parsed

ROOT = Path(__file__).parents[2]
CORE_COMMANDS = {
    *("export", "simulate", "compare", "design", "report", "controller", "examples", "validate"),
    *("terrain", "list"),
}
PLACES = ("extensions", "tests", "benchmarks", "docs", "examples")  # of folders of an extension
DELETED = {name: (name,) for name in COMMANDS} | {"every": tuple(COMMANDS)}
OWN_FILE = Path(__file__).name
DOCS = [f"tests/docs/test_{name}.py" for name in ("docs", "layers", "typed_commands")]
# of the trees, by what is asked for: the names in DELETED, and the tests that they pass
WHOLE = {"all": (list(DELETED), ["tests"]), "short": (["every"], ["tests/cli", *DOCS])}
TREES, TESTS = WHOLE.get(os.environ.get("HEXAPOD_EXTENSIONS", ""), ([], []))
# runs two commands of a tree whose package is in the folder LINKS, not the installed one
BOOT = """
import sys
sys.meta_path[:] = [f for f in sys.meta_path if not type(f).__module__.startswith("_editable")]
sys.path.insert(0, sys.argv.pop(1))
from hexapod_cosim.cosim.cli import main
sys.exit(main(["--help"]) or main(sys.argv[1:]))
"""


def tree_without(extensions: Iterable[str], place: Path) -> Path:
    """Copies the tracked files but those of some extensions; returns the copy."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    left_out = tuple(f"{place}/{one}/" for place in PLACES for one in extensions)
    for name in listed:
        if name and not name.startswith(left_out) and (ROOT / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, place / name)
    for generated in ("plant_fmu", "controller/fmu"):
        shutil.copytree(
            ROOT / generated / "generated", place / generated / "generated", dirs_exist_ok=True
        )
    return place


def linked_package(tree: Path, links: Path) -> Path:
    """Makes a folder in which the tree's folders are the package hexapod_cosim."""
    package = links / "hexapod_cosim"
    package.mkdir(parents=True)
    for part in ("models", "controller", "cosim", "extensions", "examples"):
        (package / part).symlink_to(tree / part)
    (package / "__init__.py").symlink_to(tree / "packaging" / "hexapod_cosim" / "__init__.py")
    return links


def commands_in(help_text: str) -> set[str]:
    """Returns the names of the commands that `hexapod --help` lists."""
    _, _, listed = help_text.partition("Commands:\n")
    return set(re.findall(r"^  (\w+)  ", listed, re.MULTILINE))


def imported(path: Path) -> Iterator[str]:
    """Yields the names of the modules that a file imports."""
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom):
            yield f"{node.module}."
            yield from (f"{node.module}.{alias.name}." for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (f"{alias.name}." for alias in node.names)


def test_every_extension_is_tried() -> None:
    folders = {path.name for path in (ROOT / "extensions").iterdir() if path.is_dir()}
    assert folders - {"__pycache__"} == set(COMMANDS)


def test_only_its_own_folders_import_an_extension() -> None:
    """These are deleted with it; tests/docs/test_layers.py judges the package's other folders."""
    files = [path for place in (*PLACES, "tools") for path in (ROOT / place).rglob("*.py")]
    for path in files:
        own = path.relative_to(ROOT).parts[1]
        others = tuple(f"hexapod_cosim.extensions.{name}." for name in COMMANDS if name != own)
        found = [name for name in imported(path) if name.startswith(others)]
        assert not found, f"{path.relative_to(ROOT)} imports {found}"


@pytest.mark.parametrize("deleted", DELETED)
def test_without_an_extension_the_core_walks_and_has_its_commands(
    deleted: str, tmp_path: Path
) -> None:
    tree = tree_without(DELETED[deleted], tmp_path / "tree")
    links = linked_package(tree, tmp_path / "links")

    short = ["--set", "duration=1.0", "--set", "outputs.plots=false"]
    words = ["simulate", "walk_flat", *short, "-o", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-c", BOOT, str(links), *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    left = COMMANDS.keys() - DELETED[deleted]
    others = {name for one in left for name in COMMANDS[one]}
    assert commands_in(done.stdout.partition("\nmetric ")[0]) == CORE_COMMANDS | others
    assert "results.csv" in done.stdout


@pytest.mark.parametrize("deleted", TREES)
def test_without_an_extension_the_core_installs_and_passes_its_tests(
    deleted: str, tmp_path: Path
) -> None:
    tree = tree_without(DELETED[deleted], tmp_path / "tree")
    subprocess.run(["git", "init", "-q", str(tree)], check=True)
    subprocess.run(["git", "-C", str(tree), "add", "--all"], check=True)
    venv.create(tmp_path / "venv")
    (packages,) = (tmp_path / "venv" / "lib").glob("python*/site-packages")
    # the packages that the core uses; the editable install of this tree is not seen through it
    (packages / "used.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    python = str(tmp_path / "venv" / "bin" / "python")
    install = ["-m", "pip", "install", "--quiet", "--no-deps", "--editable", "."]
    subprocess.run([python, *install], cwd=tree, check=True)
    options = ["-q", "-n", "auto", "--dist", "loadfile", f"--deselect=tests/docs/{OWN_FILE}"]
    # behind those of the new environment, which pages.py puts first: the script fmpy
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    subprocess.run(
        [python, "-m", "pytest", *options, *TESTS],
        cwd=tree,
        env=os.environ | {"PATH": path},
        check=True,
    )
