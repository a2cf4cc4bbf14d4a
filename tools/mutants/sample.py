"""Finds the mutants of the code and draws the sample: changes of one operator, comparison, sign or
constant.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, zip_longest
from pathlib import Path
from random import Random

LANES, TESTS = "plant_fmu/src/lanes", "tests/plant/test_"
NATIVE = (
    *(f"tests/native_control/test_native_{name}.py" for name in ("functions", "walks", "faults")),
    "tests/controller/test_controller_twins.py",
)
TWINS = ("tests/models/test_twin_integrator.py", "tests/friction/test_whole_plant.py")
CHOICES = "tests/trust/test_choices.py"
# group: files, and the tests that concern them, fast ones first
GROUPS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "dynamics": (
        (f"{LANES}/dynamics.h", f"{LANES}/stage.h", f"{LANES}/forces.h", f"{LANES}/spatial.h"),
        (
            *(f"{TESTS}plant_{name}.py" for name in ("dynamics", "stages")),
            *TWINS,
            *(
                f"tests/servos/test_{name}.py"
                for name in ("elastic_gear", "rotor_spin", "measured_servos")
            ),
            *(f"tests/friction/test_{name}.py" for name in ("joint_stops", "spin_and_rolling")),
            *(f"tests/ground/test_{name}.py" for name in ("laws_body", "self_contact", "faces")),
            f"{TESTS}laws_motion.py",
            CHOICES,
        ),
    ),
    "contact": (
        (
            "plant_fmu/src/contact_law.c",
            "plant_fmu/src/ground/grid_rows.h",
            f"{LANES}/foot.h",
            f"{LANES}/friction.h",
        ),
        (
            *TWINS,
            f"{TESTS}plant_functions.py",
            *(f"{TESTS}laws_{law}.py" for law in ("impact", "bristle", "stribeck", "standing")),
            *(f"tests/friction/test_{name}.py" for name in ("friction_laws", "spin_and_rolling")),
            CHOICES,
            *(f"tests/ground/test_{name}.py" for name in ("laws_soil", "grid_motion", "faces")),
            *(f"tests/soil/test_{name}.py" for name in ("plant_soil", "soil_power")),
            "tests/friction/test_plant_sticks_and_slips.py",
        ),
    ),
    "integrator": (
        ("plant_fmu/src/method.c", f"{LANES}/integrator.h", f"{LANES}/step.h"),
        (
            f"{TESTS}plant_dynamics.py",
            *TWINS,
            *(f"{TESTS}{name}.py" for name in ("plant_integrator", "plant_events", "plant_state")),
            f"{TESTS}laws_servo.py",
            CHOICES,
        ),
    ),
    "kinematics": (
        (f"{LANES}/kinematics.h", f"{LANES}/coordinates.h"),
        (
            *(f"{TESTS}{name}.py" for name in ("plant_functions", "plant_coordinates")),
            TWINS[0],
            f"{TESTS}laws_motion.py",
        ),
    ),
    "control": (("controller_fmu/src/*/*.c", "controller_fmu/src/controller.c"), NATIVE),
    "metrics": (
        ("cosim/results/metrics.py", "cosim/results/support.py", "cosim/results/balance.py"),
        (
            "tests/results/test_support.py",
            *(
                f"tests/results/test_metrics{subject}.py"
                for subject in ("", "_of_slip", "_of_motion")
            ),
            *(f"tests/results/test_{name}.py" for name in ("comparison", "footprints", "measured")),
        ),
    ),
    "controller": (
        ("controller/*.py", "controller/[a-ce-z]*/*.py"),
        (NATIVE[-1], *NATIVE[:-1], "tests/controller"),
    ),
}
SWAPS = {
    **{"+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">"},
    **{"==": "!=", "!=": "==", "&&": "||", "||": "&&", "and": "or", "or": "and"},
}
OPERATOR = re.compile(r"(?<= )(\+|-|\*|/|<=?|>=?|==|!=|&&|\|\||and|or)(?= )")
NUMBER = re.compile(r"(?<![\w.\"])(?<!e-)(\d+\.\d+(?:e-?\d+)?|[1-9]\d*)(?![\w.\"])")
SIGN = re.compile(r"(?<=[(=,] )-(?=[\w(])|(?<=[(\[])-(?=[a-z(])|(?<=return )-(?=[\w(])")
# the length of an array, before it
DECLARED = re.compile(r"\b(?!return )\w+ \*?\w+\[$|^\s+\w+ \w+\[\w+\], \w+\[$")
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


def mutants_of(group: str, tree: Path, path: Path) -> Iterator[Mutant]:
    """Yields every mutant of a file."""
    name = path.relative_to(tree).as_posix()
    for number, line in code_lines(path.read_text(encoding="utf-8"), path.suffix):
        for match in OPERATOR.finditer(line):
            yield Mutant(group, name, number, match.start(), match[0], SWAPS[match[0]])
        for match in NUMBER.finditer(line):
            if DECLARED.search(line[: match.start()]):
                continue
            yield Mutant(group, name, number, match.start(), match[0], changed_number(match[0]))
        for match in SIGN.finditer(line):
            yield Mutant(group, name, number, match.start(), "-", "")


def sample(tree: Path, seed: int, groups: list[str]) -> list[Mutant]:
    """Returns all mutants of groups in a random order, one of each group in turn."""
    random, columns = Random(seed), []
    for group in groups:
        patterns = GROUPS[group][0]
        files = sorted({path for pattern in patterns for path in tree.glob(pattern)})
        found = [mutant for path in files for mutant in mutants_of(group, tree, path)]
        random.shuffle(found)
        columns.append(found)
    return [mutant for mutant in chain(*zip_longest(*columns)) if mutant is not None]


def changed(mutant: Mutant, text: str) -> str:
    """Returns the text of the file with the mutant's change."""
    lines = text.splitlines(keepends=True)
    line = lines[mutant.line - 1]
    assert line[mutant.column :].startswith(mutant.old), mutant
    rest = line[mutant.column + len(mutant.old) :]
    lines[mutant.line - 1] = line[: mutant.column] + mutant.new + rest
    return "".join(lines)
