"""Makes small changes to a copy of the code, one at a time, and runs the tests that should fail.

usage: python -m tools.mutants COUNT [--seed N] [--concerned] [--groups GROUP ...] [--survivors]

A mutant changes one operator, comparison, sign or constant. Its tests are those of its group in
GROUPS and then, unless --concerned is given, all others, up to the first failure. They are run in
the order of a stored ranking: tests that have killed mutants of the group come first, then fast
ones. A test run that takes more processor time than LIMIT times that of the unchanged code is a
failure too, because a mutant may loop for ever.

The sample is drawn with a seed, from each group in turn, so that each part of it is a fair sample.
Results are in build/mutants/results.json; a second call continues there until COUNT mutants are
judged. --survivors judges the survivors again, after tests were added. A mutant that does not build
is left out. The copy is build/mutants/tree. It is built for speed of building: with -O1 and the
baseline kernel alone, which gives the same bits. Delete build/mutants after a change of the code.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from itertools import chain, zip_longest
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "mutants"
TREE, RESULTS = BUILD / "tree", BUILD / "results.json"
TIME_LIMIT = 3600.0  # s of wall time, of tests or of a build
LIMIT, LEAST = 5.0, 60.0  # of the processor time of the unchanged code; s
FLAGS = "-O1 -DNDEBUG -DHX_BASELINE_ONLY"  # of the copy's C code
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
    """Copies the files of the repository that differ, with an environment that imports the copy."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        given, copy = ROOT / name, TREE / name
        if given.is_file() and not (copy.exists() and filecmp.cmp(given, copy, shallow=False)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(given, copy)
            shutil.copymode(given, copy)
    if not (TREE / ".venv").exists():
        set_up()
    build_faster()


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
    (inner / "mutants.pth").write_text("\n".join(paths) + "\n", encoding="utf-8")


def build_faster() -> None:
    """Changes how the copy is built: FLAGS instead of -O3."""
    presets = TREE / "CMakePresets.json"
    table = json.loads(presets.read_text(encoding="utf-8"))
    chosen = next(one for one in table["configurePresets"] if one["name"] == "test")
    chosen["cacheVariables"]["CMAKE_C_FLAGS_RELEASE"] = FLAGS
    lists = TREE / "plant_fmu" / "CMakeLists.txt"
    text = lists.read_text(encoding="utf-8").replace("$<$<CONFIG:Release>:-O3>", "")
    presets.write_text(json.dumps(table), encoding="utf-8")
    lists.write_text(text, encoding="utf-8")


def in_tree(
    *arguments: str, seconds: float = 0.0, env: dict[str, str] | None = None
) -> tuple[bool, str]:
    """Runs the copy's Python, for `seconds` of processor time at most (0: any).

    Returns whether it succeeded, and the last lines of its output.
    """
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    outside = {"PATH": search, "PYTHONPATH": "", "PYTHONDONTWRITEBYTECODE": "1"}

    def limit() -> None:
        if seconds:
            resource.setrlimit(resource.RLIMIT_CPU, (round(seconds), round(seconds) + 5))

    try:
        done = subprocess.run(
            [str(TREE / ".venv" / "bin" / "python"), *arguments],
            cwd=TREE,
            env=os.environ | outside | (env or {}),
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIME_LIMIT,
            check=False,
            preexec_fn=limit,
        )
    except subprocess.TimeoutExpired:
        return False, f"more than {TIME_LIMIT:g} s"
    if done.returncode == -signal.SIGXCPU:
        return False, f"more than {seconds:.0f} s of processor time"
    return done.returncode == 0, (done.stdout + done.stderr)[-2000:]


def builds() -> tuple[bool, str]:
    """Builds the copy's C code."""
    code = "import sys; sys.path.insert(0, 'tests/support'); import building; building.built()"
    return in_tree("-c", code)


def passes(
    *tests: str, seconds: float = 0.0, env: dict[str, str] | None = None
) -> tuple[bool, str]:
    """Runs tests of the copy up to the first failure."""
    options = ("-q", "-x", "-n", "0", "-p", "tools.mutants_order", "-p", "no:cacheprovider")
    return in_tree("-m", "pytest", *options, *tests, seconds=seconds, env=env)


# ---- the ranking of the tests ----


@dataclass(frozen=True)
class Ranking:
    """What the unchanged copy's tests of one group take."""

    seconds: float  # of processor time, all tests together
    durations: dict[str, float]  # s, of each test

    def write(self, results: list[dict[str, Any]], group: str) -> Path:
        """Writes the rank of each test for the plugin, and returns the file's path.

        Tests that killed mutants of the group come first, most kills first, then fast ones.
        """
        kills = Counter(one["by"] for one in results if one["group"] == group)
        tests = sorted(self.durations, key=lambda test: (-kills[test], self.durations[test]))
        path = BUILD / f"{group}-order.json"
        path.write_text(json.dumps({test: rank for rank, test in enumerate(tests)}), "utf-8")
        return path


def ranked(group: str) -> Ranking:
    """Returns the stored ranking of a group, or measures it: its tests must pass.

    Raises SystemExit when they fail.
    """
    path, raw = BUILD / f"{group}-ranking.json", BUILD / "durations.json"
    if not path.exists():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        passed, output = passes(*GROUPS[group][1], env={"HEXAPOD_DURATIONS": str(raw)})
        if not passed:
            raise SystemExit(f"mutants: the unchanged copy fails\n{output}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        durations = json.loads(raw.read_text(encoding="utf-8"))
        path.write_text(json.dumps({"seconds": seconds, "durations": durations}), "utf-8")
    return Ranking(**json.loads(path.read_text(encoding="utf-8")))


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


def judge(mutant: Mutant, results: list[dict[str, Any]], *, concerned: bool) -> dict[str, Any]:
    """Tests one mutant; returns its fate, what killed it, and the changed line."""
    ranking = ranked(mutant.group)
    order = {"HEXAPOD_ORDER": str(ranking.write(results, mutant.group))}
    seconds = LIMIT * ranking.seconds + LEAST
    place = TREE / mutant.file
    original = place.read_text(encoding="utf-8")
    text = changed(mutant, original)
    line = text.splitlines()[mutant.line - 1]
    try:
        place.write_text(text, encoding="utf-8")
        alive, output = builds() if mutant.file.endswith((".c", ".h")) else (True, "")
        fate = "survived" if alive else "does not build"
        if fate == "survived":
            alive, output = passes(*GROUPS[mutant.group][1], seconds=seconds, env=order)
            fate = "survived" if alive else "killed"
        if fate == "survived" and not concerned:
            alive, output = passes("tests", env=order)
            fate = "survived" if alive else "killed"
    finally:
        place.write_text(original, encoding="utf-8")
    by = first_failure(output) if fate == "killed" else ""
    return {**asdict(mutant), "fate": fate, "by": by, "text": line.strip(), "concerned": concerned}


def told(one: dict[str, Any]) -> dict[str, Any]:
    """Prints the fate of a mutant and returns it with the time."""
    print(f"{one['fate']:15}{one['file']}:{one['line']}: {one['text']}  {one['by']}", flush=True)
    return {**one, "at": datetime.now(UTC).isoformat(timespec="seconds")}


def continued(
    results: list[dict[str, Any]], given: argparse.Namespace
) -> Iterator[list[dict[str, Any]]]:
    """Judges mutants of the sample until enough are; yields all results after each."""
    known = {tuple(one[key] for key in ("file", "line", "column", "new")) for one in results}
    for mutant in sample(given.seed, given.groups):
        if sum(one["fate"] != "does not build" for one in results) >= given.count:
            return
        if (mutant.file, mutant.line, mutant.column, mutant.new) not in known:
            results = [*results, told(judge(mutant, results, concerned=given.concerned))]
            yield results


def judged_again(
    results: list[dict[str, Any]], given: argparse.Namespace
) -> Iterator[list[dict[str, Any]]]:
    """Judges the survivors of groups again; yields all results after each."""
    for k, one in enumerate(results):
        if one["fate"] == "survived" and one["group"] in given.groups:
            mutant = Mutant(**{item.name: one[item.name] for item in fields(Mutant)})
            results = [*results]
            results[k] = told(judge(mutant, results, concerned=given.concerned))
            yield results


def main() -> int:
    """Judges mutants until COUNT of them are; prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int, help="the number of mutants to judge")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--concerned", action="store_true", help="run the group's tests only")
    parser.add_argument("--survivors", action="store_true", help="judge survivors again")
    parser.add_argument("--groups", nargs="+", choices=[*GROUPS], default=[*GROUPS])
    given = parser.parse_args()
    copy_tree()
    passed, output = builds()
    if not passed:
        raise SystemExit(f"mutants: the unchanged copy does not build\n{output}")
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else []
    judged = judged_again if given.survivors else continued
    for results in judged(results, given):  # noqa: B020 (the generator has the list already)
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    for group in GROUPS:
        fates = Counter(one["fate"] for one in results if one["group"] == group)
        print(f"{group:12}{fates['killed']:4} killed {fates['survived']:4} survived")
    return 0


if __name__ == "__main__":
    sys.exit(main())
