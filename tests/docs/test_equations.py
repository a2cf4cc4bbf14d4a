"""Equations of docs/equations.md: numbered in the order of the page, and every citation names one.

A citation is `eq. N`, `eq. N-M`, or a list of these. The source's own equations are cited as
`paper eq. N`, control laws of docs/control/ as `eq. CN`.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
OF_PAPER = 5  # equations that the source has
TAG = re.compile(r"\\tag\{([^}]*)\}")
CITED = re.compile(r"(paper )?\b[Ee]qs?\. (\d+(?:(?:-|, | and )\d+\b(?!\.\d))*)")
# equations of one form only: the sweep in O(n), to which models/ is dense, and the complex step
IN_C_ALONE = {8, 9, 10, 11, 25, 55}
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
    assert page_numbers() == list(range(1, 59))


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
