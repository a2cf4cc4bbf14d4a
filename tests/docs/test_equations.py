"""Equations of docs/equations.md: numbered in the order of the page, and every citation names one.

A citation is `eq. N`, `eq. N-M`, or a list of these. The source's own equations are cited as
`paper eq. N`, control laws of docs/control/ as `eq. CN`.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from pages import COMMANDS, parsed

from hexapod_cosim.models import CONTACT_LAWS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
OF_PAPER = 5  # equations that the source has
TAG = re.compile(r"\\tag\{([^}]*)\}")
CITED = re.compile(r"(paper )?\b[Ee]qs?\. (\d+(?:(?:-|, | and )\d+\b(?!\.\d))*)")
# equations of one form only: the sweep in O(n), to which models/ is dense, and the complex step
IN_C_ALONE = {8, 9, 10, 11, 25, 55}
# a C function, defined or declared, with the comment above it that says what it computes
FUNCTION = re.compile(
    r"/\*((?:(?!\*/).)*)\*/\n(?:HX_\w+ |static |inline |const )*\w+ \*?(\w+)\([^;{}]*\)(?: \{|;)",
    re.DOTALL,
)
# the modules of models/ with the equations of a file of plant_fmu/src
TWINS = {
    "command/command.c": ["servos/motor"],
    "command/command.h": ["servos/motor"],
    "contact_law.c": ["contact/law"],
    "contact_law.h": ["contact/law"],
    "ground/sharing.h": ["contact/geometry"],
    "ground/soil.h": ["soil/law"],
    "ground/smooth.h": ["ground/smooth"],
    "ground/soil_law.h": ["soil/law"],
    "ground/surface.c": ["ground/blocks"],
    "kernels/integrator.h": ["integrator", "measure"],
    "kernels/output.h": ["energy"],
    "kernels/step.h": ["step"],
    "lanes/clearance.h": ["contact/bodies", "contact/forces"],
    "lanes/actuator.h": ["actuator", "servos/motor"],
    "lanes/dynamics.h": ["dynamics"],
    "lanes/foot.h": ["contact/law", "contact/forces"],
    "lanes/forces.h": ["dynamics", "actuator"],
    "lanes/friction.h": ["friction", "contact/geometry"],
    "lanes/soil_path.h": ["method", "contact/forces", "contact/switching"],
    "lanes/stage.h": ["stage"],
    "measure/foot_measure.h": ["measure", "method"],
    "measure/joint_measure.h": ["servos/motor"],
    "measure/step_path.h": ["method"],
    "measure/works.h": ["measure"],
    "method.h": ["integrator"],
    "packs/vec3.h": ["kinematics"],
    "robot/laws.c": [],
}
# functions that cite an equation and have no counterpart in models/, with the reason
OF_SWEEP = "the O(n) solution, to which models/dynamics.py and models/stage.py are dense"
IN_C_WITH_REASON = {
    "joint_bias": OF_SWEEP,
    "couple_rotor": OF_SWEEP,
    "rotor_coupling": OF_SWEEP,
    "sweep_inertia": OF_SWEEP,
    "sweep_force": OF_SWEEP,
    "sweep_inverse": OF_SWEEP,
    "sweep_motion": OF_SWEEP,
    "sweep_sum": OF_SWEEP,
    "rotor_motion": OF_SWEEP,
    "torso_acceleration": OF_SWEEP,
    "leg_multipliers": OF_SWEEP,
    "gear_frictions": OF_SWEEP,
    "turning_drag": OF_SWEEP,
    "bristle_response": OF_SWEEP,
    "stage_bristle_rate": OF_SWEEP,
    "store_torso_rate": OF_SWEEP,
    "store_link_rate": OF_SWEEP,
    "dynamics_evaluate": OF_SWEEP,
    "replace_by_soil": "the part of `contact_force` on soil, for lanes that touched down on it",
    "store_powers": "rates of the works of eq. 27, which `step_works` computes",
    "add_impulses": "sums over the stages of a step, which `step_works` receives",
    "fill_energy": "the sum of works and of energies that other functions compute",
    "move_drive": "commands that change within a call, which models/ leaves out",
    "wanted_torque": "the first line of `servo_torque`, before the limits",
    "cone_with_soil": "the cone on soil; `measure_cone` is for rigid ground",
}
TEXTS = {".c", ".h", ".py", ".md", ".toml", ".ipynb", ".cpp"}


def page_numbers() -> list[int]:
    return [int(number) for number in TAG.findall(PAGE.read_text(encoding="utf-8"))]


def cited_files() -> list[Path]:
    folders = ("models", "controller", "plant_fmu", "controller/fmu", "cosim", "docs", "tests")
    more = ("benchmarks", "examples", "tools")
    paths = [path for folder in (*folders, *more) for path in (ROOT / folder).rglob("*")]
    kept = [path for path in paths if path.suffix in TEXTS and "node_modules" not in path.parts]
    return [*sorted(kept), ROOT / "README.md", ROOT / ".github" / "CONTRIBUTING.md"]


def citations(text: str) -> list[tuple[str, bool, set[int]]]:
    """What is cited: the words, whether they are the paper's, and the numbers."""
    found = []
    for match in CITED.finditer(text):
        numbers: set[int] = set()
        for part in re.split(", | and ", match[2]):
            first, _, last = part.partition("-")
            numbers |= set(range(int(first), int(last or first) + 1))
        found.append((match[0], bool(match[1]), numbers))
    return found


def test_equations_are_numbered_in_the_order_of_the_page() -> None:
    assert page_numbers() == list(range(1, 60))


def test_every_displayed_formula_of_the_page_has_a_number() -> None:
    blocks = re.findall(r"```math\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert [block for block in blocks if not TAG.search(block)] == []


@pytest.mark.parametrize(("folder", "absent"), [("models", IN_C_ALONE), ("plant_fmu/src", set())])
def test_each_equation_is_cited_where_it_is_computed(folder: str, absent: set[int]) -> None:
    texts = [path for path in (ROOT / folder).rglob("*") if path.suffix in {".c", ".h", ".py"}]
    found: set[int] = set()
    for path in texts:
        for _, of_paper, numbers in citations(path.read_text(encoding="utf-8")):
            found |= set() if of_paper else numbers
    assert set(page_numbers()) - found == absent


def test_every_citation_names_an_equation_that_exists() -> None:
    known, count = set(page_numbers()), 0
    for path in cited_files():
        for words, of_paper, numbers in citations(path.read_text(encoding="utf-8")):
            count += 1
            allowed = set(range(1, OF_PAPER + 1)) if of_paper else known
            where = path.relative_to(ROOT)
            assert numbers <= allowed, f"{where}: {words}: expected one of {sorted(allowed)}"
    assert count > 100


def functions_of_the_plant() -> list[tuple[str, str]]:
    """File and name, without hx_, of the C functions whose comment cites an equation."""
    found, source = [], ROOT / "plant_fmu" / "src"
    for path in sorted(path for path in source.rglob("*") if path.suffix in {".c", ".h"}):
        for comment, name in FUNCTION.findall(path.read_text(encoding="utf-8")):
            if citations(comment):
                found.append((path.relative_to(source).as_posix(), name.removeprefix("hx_")))
    return found


def functions_of_models(module: str) -> set[str]:
    tree = parsed(ROOT / "models" / f"{module}.py")
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_a_function_of_the_plant_has_the_name_of_its_equation_in_models() -> None:
    alone = set()
    for file, name in functions_of_the_plant():
        if not any(name in functions_of_models(module) for module in TWINS[file]):
            alone.add(name)
    assert alone == set(IN_C_WITH_REASON)


@pytest.mark.parametrize(
    ("file", "names"),
    [
        (
            "lanes/friction.h",
            "stribeck_curve friction_direction friction_drag bristle_friction lugre_friction "
            "turning_moment",
        ),
        (
            "lanes/actuator.h",
            "motor_torque servo_torque servo_slopes stribeck_share quadratic_friction "
            "measured_friction stop_torque",
        ),
        ("lanes/foot.h", "normal_force"),
        ("measure/foot_measure.h", "measure_feet measure_landing measure_cone parabola"),
    ],
)
def test_the_laws_of_a_file_have_their_names_in_both_languages(file: str, names: str) -> None:
    ours = {name for of, name in functions_of_the_plant() if of == file}
    assert ours - set(IN_C_WITH_REASON) == set(names.split())


def test_contact_laws_have_their_names_in_both_languages() -> None:
    text = (ROOT / "plant_fmu/src/contact_law.c").read_text(encoding="utf-8")
    rows = re.findall(r"static double (\w+)\(const hxDefinition \*d\)", text)
    assert tuple(rows) == CONTACT_LAWS


# of files of the repository, as comments and docstrings name them
NAMED = re.compile(
    r"(?<![\w/.\-{}])"
    r"((?:models|plant_fmu|fmi|controller|cosim|extensions|tests|docs|tools|benchmarks)"
    r"/[\w/]+\.(?:py|c|h|toml|md))\b"
)


def test_files_that_the_code_names_exist() -> None:
    count = 0
    for path in cited_files():
        for name in NAMED.findall(path.read_text(encoding="utf-8")):
            count += 1
            extension = ROOT / "extensions" / name.split("/")[1]
            deleted = extension.name in COMMANDS and not extension.is_dir()
            places = (ROOT, *path.parents)  # the page of an extension names its own folders
            found = any((place / name).exists() for place in places if place.is_relative_to(ROOT))
            assert found or deleted, f"{path.relative_to(ROOT)} names {name}, which is not there"
    assert count > 100
