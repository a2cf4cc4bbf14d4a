"""Makes small changes to a copy of the code, one at a time, and runs the tests that should fail.

usage: python -m tools.mutants COUNT [--seed N] [--concerned] [--groups GROUP ...]

A mutant changes one operator, comparison, sign or constant. Its tests are those of its group in
GROUPS and then, unless --concerned is given, all others. The sample is drawn with a seed, from each
group in turn. Results are in build/mutants/results.json; a second call continues there until COUNT
mutants are judged. A mutant that does not build is left out. The copy is build/mutants/tree; delete
build/mutants after a change of the code.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from itertools import chain, zip_longest
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "mutants"
TREE, RESULTS = BUILD / "tree", BUILD / "results.json"
TIME_LIMIT = 3600  # s  of tests; an endless loop is a dead mutant
LANES, TESTS = "plant_fmu/src/lanes", "tests/plant/test_"
NATIVE = ("tests/controller/test_native_controller.py", "tests/controller/test_controller_twins.py")
# group: files, and the tests that concern them
GROUPS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "dynamics": (
        (f"{LANES}/dynamics.h", f"{LANES}/stage.h", f"{LANES}/forces.h", f"{LANES}/spatial.h"),
        (f"{TESTS}plant_dynamics.py", f"{TESTS}laws_motion.py", f"{TESTS}plant_stages.py"),
    ),
    "contact": (
        ("plant_fmu/src/contact_law.c", f"{LANES}/foot.h", f"{LANES}/friction.h"),
        (
            *(f"{TESTS}laws_{law}.py" for law in ("impact", "bristle", "stribeck", "standing")),
            "tests/friction",
        ),
    ),
    "integrator": (
        ("plant_fmu/src/method.c", f"{LANES}/integrator.h"),
        (f"{TESTS}plant_integrator.py", f"{TESTS}plant_events.py", f"{TESTS}plant_state.py"),
    ),
    "kinematics": (
        (f"{LANES}/kinematics.h", f"{LANES}/coordinates.h"),
        (f"{TESTS}plant_functions.py", f"{TESTS}plant_coordinates.py", f"{TESTS}laws_motion.py"),
    ),
    "control": (("controller_fmu/src/*/*.c", "controller_fmu/src/controller.c"), NATIVE),
    "metrics": (
        ("cosim/results/metrics.py", "cosim/results/support.py", "cosim/results/balance.py"),
        ("tests/results",),
    ),
    "controller": (("controller/*.py", "controller/[a-ce-z]*/*.py"), ("tests/controller",)),
}
SWAPS = {
    **{"+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">"},
    **{"==": "!=", "!=": "==", "&&": "||", "||": "&&", "and": "or", "or": "and"},
}
OPERATOR = re.compile(r"(?<= )(\+|-|\*|/|<=?|>=?|==|!=|&&|\|\||and|or)(?= )")
NUMBER = re.compile(r"(?<![\w.\"])(?<!e-)(\d+\.\d+(?:e-?\d+)?|[1-9]\d*)(?![\w.\"])")
SIGN = re.compile(r"(?<=[(=,] )-(?=[\w(])|(?<=[(\[])-(?=[a-z(])|(?<=return )-(?=[\w(])")
SKIPPED = re.compile(r"^\s*(#|\*|/\*|//|import |from |assert |@|\"\"\"|\w+: |static const|enum )")


@dataclass(frozen=True)
class Mutant:
    """One change of one line."""

    group: str
    file: str
    line: int  # from 1
    column: int
    old: str
    new: str


def changed_number(text: str) -> str:
    """Returns another number of the same type."""
    return str(int(text) + 1) if text.isdigit() else repr(1.5 * float(text) or 1.0)


def code_lines(text: str, suffix: str) -> Iterator[tuple[int, str]]:
    """Yields numbers and texts of lines that contain statements, without trailing comments."""
    inside = False  # a comment or docstring of several lines
    begin, end, trailing = ('"""', '"""', "#") if suffix == ".py" else ("/*", "*/", "/*")
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if inside:
            inside = end not in stripped
        elif stripped.startswith(begin):
            inside = end not in stripped[len(begin) :]
        elif not SKIPPED.match(line) and '"' not in line and "'" not in line:
            yield number, line.split(trailing)[0]


def mutants_of(group: str, path: Path) -> Iterator[Mutant]:
    """Yields every mutant of a file."""
    name = path.relative_to(TREE).as_posix()
    for number, line in code_lines(path.read_text(encoding="utf-8"), path.suffix):
        for match in OPERATOR.finditer(line):
            yield Mutant(group, name, number, match.start(), match[0], SWAPS[match[0]])
        for match in NUMBER.finditer(line):
            yield Mutant(group, name, number, match.start(), match[0], changed_number(match[0]))
        for match in SIGN.finditer(line):
            yield Mutant(group, name, number, match.start(), "-", "")


def sample(seed: int, groups: list[str]) -> list[Mutant]:
    """Returns all mutants of groups in a random order, one of each group in turn."""
    random, columns = Random(seed), []
    for group in groups:
        patterns = GROUPS[group][0]
        files = sorted({path for pattern in patterns for path in TREE.glob(pattern)})
        found = [mutant for path in files for mutant in mutants_of(group, path)]
        random.shuffle(found)
        columns.append(found)
    return [mutant for mutant in chain(*zip_longest(*columns)) if mutant is not None]


# ---- the copy ----


def copy_tree() -> None:
    """Copies the files of the repository, with an environment that imports the copy."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (TREE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, TREE / name)
    if (ROOT / "build" / "viewer").is_dir():
        shutil.copytree(ROOT / "build" / "viewer", TREE / "build" / "viewer", symlinks=True)
    subprocess.run(["make", "--silent", "typing"], cwd=TREE, check=True)
    command = [sys.executable, "-m", "venv", "--without-pip", str(TREE / ".venv")]
    subprocess.run(command, check=True)
    # the packages of this environment, but not its link to the original's code
    inner = next((TREE / ".venv").glob("lib/python*/site-packages"))
    paths = [str(TREE / "build" / "typing"), sysconfig.get_path("purelib")]
    (inner / "mutants.pth").write_text("\n".join(paths) + "\n", encoding="utf-8")


def in_tree(*arguments: str, limit: float) -> tuple[bool, str]:
    """Runs the copy's Python; returns whether it succeeded, and the last lines of its output."""
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    try:
        done = subprocess.run(
            [str(TREE / ".venv" / "bin" / "python"), *arguments],
            cwd=TREE,
            env=os.environ | {"PATH": search, "PYTHONPATH": "", "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"more than {limit:g} s"
    return done.returncode == 0, (done.stdout + done.stderr)[-2000:]


def builds() -> tuple[bool, str]:
    """Builds the copy's C code."""
    code = "import sys; sys.path.insert(0, 'tests/support'); import building; building.built()"
    return in_tree("-c", code, limit=TIME_LIMIT)


def passes(*tests: str) -> tuple[bool, str]:
    """Runs tests of the copy up to the first failure."""
    return in_tree("-m", "pytest", "-q", "-x", "-n", "0", *tests, limit=TIME_LIMIT)


def first_failure(output: str) -> str:
    """Returns the test that failed, or the end of the output."""
    match = re.search(r"^(?:FAILED|ERROR) (\S+)", output, re.MULTILINE)
    return match[1] if match else output[-200:].strip()


def changed(mutant: Mutant, text: str) -> str:
    """Returns the text of the file with the mutant's change."""
    lines = text.splitlines(keepends=True)
    line = lines[mutant.line - 1]
    assert line[mutant.column :].startswith(mutant.old), mutant
    rest = line[mutant.column + len(mutant.old) :]
    lines[mutant.line - 1] = line[: mutant.column] + mutant.new + rest
    return "".join(lines)


def judge(mutant: Mutant, *, concerned: bool) -> dict[str, Any]:
    """Tests one mutant; returns its fate, what killed it, and the changed line."""
    tests = GROUPS[mutant.group][1]
    place = TREE / mutant.file
    original = place.read_text(encoding="utf-8")
    text = changed(mutant, original)
    line = text.splitlines()[mutant.line - 1]
    try:
        place.write_text(text, encoding="utf-8")
        alive, output = builds() if mutant.file.endswith((".c", ".h")) else (True, "")
        fate = "survived" if alive else "does not build"
        for part in ([*tests], [] if concerned else ["tests"]):
            if fate == "survived" and part:
                alive, output = passes(*part)
                fate = "survived" if alive else "killed"
    finally:
        place.write_text(original, encoding="utf-8")
    by = first_failure(output) if fate == "killed" else ""
    return {**asdict(mutant), "fate": fate, "by": by, "text": line.strip(), "concerned": concerned}


def main() -> int:
    """Judges mutants until COUNT of them are; prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int, help="the number of mutants to judge")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--concerned", action="store_true", help="run the group's tests only")
    parser.add_argument("--groups", nargs="+", choices=[*GROUPS], default=[*GROUPS])
    given = parser.parse_args()
    if not TREE.exists():
        copy_tree()
    for passed, output in (builds(), *(passes(*GROUPS[group][1]) for group in given.groups)):
        if not passed:
            raise SystemExit(f"mutants: the unchanged copy fails\n{output}")
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else []
    known = {tuple(one[key] for key in ("file", "line", "column", "new")) for one in results}
    for mutant in sample(given.seed, given.groups):
        if sum(one["fate"] != "does not build" for one in results) >= given.count:
            break
        if (mutant.file, mutant.line, mutant.column, mutant.new) in known:
            continue
        at = datetime.now(UTC).isoformat(timespec="seconds")
        results.append({**judge(mutant, concerned=given.concerned), "at": at})
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
        one = results[-1]
        print(
            f"{one['fate']:15}{one['file']}:{one['line']}: {one['text']}  {one['by']}", flush=True
        )
    for group in GROUPS:
        fates = Counter(one["fate"] for one in results if one["group"] == group)
        print(f"{group:12}{fates['killed']:4} killed {fates['survived']:4} survived")
    return 0


if __name__ == "__main__":
    sys.exit(main())
