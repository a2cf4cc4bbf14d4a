"""Copies the repository to build/mutants/tree and builds it, with many mutants in one build or with
one.

The copy is built for speed of building: with -O1, and with the baseline kernel alone unless all are
asked for, which gives the same bits. Sources with mutants are written, built and then restored with
their old times, so that tests read the sources as they are, and the binaries do not count as stale.
"""

from __future__ import annotations

import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tools.mutants.sample import Mutant, changed
from tools.mutants.switch import HEADER, switched

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "mutants"
TREE, SWITCHES = BUILD / "tree", BUILD / "switches.json"
INCLUDED = BUILD / "switch.h"
FLAGS = f"-O1 -DNDEBUG -include {INCLUDED}"  # of the copy's C code
SESSION = "mutants"  # tests do not build when the last build names this session
PYTHON = TREE / ".venv" / "bin" / "python"


def faster_presets(text: str, kernels: bool) -> str:
    """Returns the presets with FLAGS."""
    table = json.loads(text)
    chosen = next(one for one in table["configurePresets"] if one["name"] == "test")
    flags = FLAGS if kernels else f"{FLAGS} -DHX_BASELINE_ONLY"
    chosen["cacheVariables"]["CMAKE_C_FLAGS_RELEASE"] = flags
    return json.dumps(table)


# files that are changed in the copy, for another build
FASTER: dict[str, Callable[[str, bool], str]] = {
    "CMakePresets.json": faster_presets,
    "plant_fmu/CMakeLists.txt": lambda text, _: text.replace("$<$<CONFIG:Release>:-O3>", ""),
}


def write_changed(path: Path, text: str) -> None:
    """Writes a file unless it has this text."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def copy_tree(kernels: bool = False) -> None:
    """Copies the files of the repository that differ, with an environment that imports the copy,
    and chooses the build of all kernels or of the baseline alone.

    Files that stay as they are keep their times, so that the build stays as it is.
    """
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        given, copy = ROOT / name, TREE / name
        if name in FASTER:
            copy.parent.mkdir(parents=True, exist_ok=True)
            write_changed(copy, FASTER[name](given.read_text(encoding="utf-8"), kernels))
        elif given.is_file() and not (copy.exists() and filecmp.cmp(given, copy, shallow=False)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(given, copy)
            shutil.copymode(given, copy)
    write_changed(INCLUDED, HEADER)
    if not (TREE / ".venv").exists():
        set_up()


def set_up() -> None:
    """Gives the copy the built viewer and an environment."""
    if (ROOT / "build" / "viewer").is_dir():
        shutil.copytree(ROOT / "build" / "viewer", TREE / "build" / "viewer", symlinks=True)
    subprocess.run(["make", "--silent", "typing"], cwd=TREE, check=True)
    command = [sys.executable, "-m", "venv", "--without-pip", str(TREE / ".venv")]
    subprocess.run(command, check=True)
    # the packages of this environment, but not its link to the original's code
    inner = next((TREE / ".venv").glob("lib/python*/site-packages"))
    packages = Path(sysconfig.get_path("purelib"))
    paths = [str(TREE / "build" / "typing"), str(packages)]
    paths += map(str, packages.glob("cmeel.prefix/lib/python*/site-packages"))  # Pinocchio's
    paths += ["import mutants_hook"]
    shutil.copyfile(Path(__file__).with_name("hook.py"), inner / "mutants_hook.py")
    (inner / "mutants.pth").write_text("\n".join(paths) + "\n", encoding="utf-8")


def environment() -> dict[str, str]:
    """Returns the environment of the copy's programs."""
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return os.environ | {"PATH": search, "PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}


def build() -> tuple[bool, str]:
    """Builds the copy's C code; returns whether it succeeded, and the output."""
    session = TREE / "build" / ".test.session"
    session.unlink(missing_ok=True)
    code = "import sys; sys.path.insert(0, 'tests/support'); import building; building.built()"
    done = subprocess.run(
        [str(PYTHON), "-c", code],
        cwd=TREE,
        env=environment() | {"PYTEST_XDIST_TESTRUNUID": SESSION},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    return done.returncode == 0, done.stdout + done.stderr


@contextmanager
def written(texts: dict[str, str]) -> Iterator[None]:
    """Writes other texts of files; restores the files and their times in the end."""
    before = {name: ((TREE / name).read_bytes(), (TREE / name).stat()) for name in texts}
    try:
        for name, text in texts.items():
            (TREE / name).write_text(text, encoding="utf-8")
        yield
    finally:
        for name, (data, times) in before.items():
            (TREE / name).write_bytes(data)
            os.utime(TREE / name, ns=(times.st_atime_ns, times.st_mtime_ns))


def build_switched(mutants: dict[int, Mutant], kernels: bool = False) -> set[int]:
    """Builds the copy with all mutants that can be switched; returns their numbers.

    A mutant is left out where the compiler refuses it. Raises SystemExit when it refuses the rest.
    """
    wanted: dict[str, Any] = {"kernels": kernels}
    wanted |= {str(number): asdict(mutant) for number, mutant in mutants.items()}
    if SWITCHES.exists():
        stored = json.loads(SWITCHES.read_text(encoding="utf-8"))
        if stored["wanted"] == wanted and build()[0] and stored["libraries"] == libraries():
            return set(stored["built"])
    left = dict(mutants)
    while True:
        texts, refused = switched_texts(left)
        if not refused:
            with written(texts):
                passed, output = build()
            if passed:
                break
            refused = set(_named(output, left))
        if not refused:
            raise SystemExit(f"mutants: the copy does not build\n{output[-3000:]}")
        left = {number: mutant for number, mutant in left.items() if number not in refused}
    stored = {"wanted": wanted, "built": sorted(left), "libraries": libraries()}
    SWITCHES.write_text(json.dumps(stored), encoding="utf-8")
    return set(left)


def libraries() -> dict[str, int]:
    """Returns the times of the built libraries, by which a later build is told."""
    found = sorted((TREE / "build" / "plant").rglob("*.so"))
    return {str(path): path.stat().st_mtime_ns for path in found}


def switched_texts(mutants: dict[int, Mutant]) -> tuple[dict[str, str], set[int]]:
    """Returns the texts of files with their mutants, and the mutants that are in no expression."""
    files: dict[str, list[tuple[int, Mutant]]] = defaultdict(list)
    refused = set()
    for number, mutant in mutants.items():
        try:
            switched((TREE / mutant.file).read_text(encoding="utf-8"), [(number, mutant)])
            files[mutant.file].append((number, mutant))
        except ValueError:
            refused.add(number)
    texts = {
        name: switched((TREE / name).read_text(encoding="utf-8"), of) for name, of in files.items()
    }
    return texts, refused


def _named(output: str, mutants: dict[int, Mutant]) -> Iterable[int]:
    """Yields the mutants of the lines that a compiler's errors name."""
    for match in re.finditer(r"(\S+?):(\d+):\d+: error", output):
        for number, mutant in mutants.items():
            if match[1].endswith(mutant.file.rpartition("/")[2]) and int(match[2]) == mutant.line:
                yield number


@contextmanager
def alone(mutant: Mutant) -> Iterator[tuple[bool, str]]:
    """Builds the copy with one mutant. Its file stays changed for tests that build anew; then it is
    restored, and built by the next build.
    """
    SWITCHES.unlink(missing_ok=True)
    text = changed(mutant, (TREE / mutant.file).read_text(encoding="utf-8"))
    try:
        with written({mutant.file: text}):
            yield build()
    finally:
        os.utime(TREE / mutant.file)
