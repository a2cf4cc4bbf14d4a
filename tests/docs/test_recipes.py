"""The recipes of CONTRIBUTING: their examples are in the named files and in no other code."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("models", "plant_fmu", "fmi", "controller", "cosim", "extensions")
CODE = [f":(glob){room}/**/{kind}" for room in ROOMS for kind in ("*.[ch]", "*.py", "*.ts")]
MOST = {"sway": 6}  # files of a recipe, with its page; 5 of the others
ROW = re.compile(r"^\| an? [^|]+ \| (\w+) \| ([^|]+) \|$", re.MULTILINE)
RECIPES = ROW.findall((ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8"))


def test_there_is_a_recipe_for_terrains_metrics_laws_and_parts_of_the_controller() -> None:
    assert [name for name, _ in RECIPES] == ["dune", "force_p95", "lugre", "hunt_crossley", "sway"]


@pytest.mark.parametrize(("name", "listed"), RECIPES, ids=[name for name, _ in RECIPES])
def test_a_recipe_names_every_file(name: str, listed: str) -> None:
    """`git grep` finds the example in any case, also within a longer name (HX_FRICTION_LUGRE).

    Scenarios and cases, which only use it, are no code.
    """
    pattern = f"(^|[^a-z]){name}([^a-z]|$)"
    code = [*CODE, "*/interface.toml", ":!*generated*"]
    command = ["git", "grep", "-liE", pattern, "--", *code]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    named = listed.split(", ")
    assert sorted(found.split()) == sorted(one for one in named if not one.startswith("docs/"))
    assert len(named) <= MOST.get(name, 5)
    (page,) = [ROOT / one for one in named if one.startswith("docs/")]
    assert re.search(rf"\b{name}\b", page.read_text(encoding="utf-8"), re.IGNORECASE)
