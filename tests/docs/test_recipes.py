"""The recipes of CONTRIBUTING: their examples are in the named files and in no other code, and
whoever follows them has a law and a terrain that work.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from command import QUICK, settings

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


# the recipes, followed in a copy

FROM_THE_COPY = """
import sys
sys.meta_path[:] = [f for f in sys.meta_path if not type(f).__module__.startswith("_editable")]
sys.path.insert(0, "links")
"""
FRICTION = {  # file -> text, and what the reader of the recipe writes below it
    "models/friction.py": [
        (
            "    return math.tanh(x) / speed if x > 1e-5 else "
            "friction.slope * (1.0 - x * x / 3.0)\n",
            "\n\ndef rational_direction(friction: Friction, speed: float) -> float:\n"
            '    """Returns g = k_t/(1 + k_t v) [s/m] at a speed [m/s]."""\n'
            "    return friction.slope / (1.0 + friction.slope * speed)\n",
        ),
        (
            '    "lugre": FrictionLaw(grip=lugre_friction, sliding=lugre_sliding),\n',
            '    "rational": FrictionLaw(rational_direction),\n',
        ),
    ],
    "plant_fmu/src/lanes/friction.h": [
        (
            "  case HX_FRICTION_NONE:\n    return hx_splat(0.0);\n",
            "  case HX_FRICTION_RATIONAL:\n"
            "    return model->slope / (1.0 + model->slope * speed);\n",
        )
    ],
    "plant_fmu/src/state.h": [
        ("[HX_FRICTION_LUGRE] = {1, 1},\n", "[HX_FRICTION_RATIONAL] = {1, 0},\n")
    ],
    "plant_fmu/interface.toml": [
        (
            'lugre = "LuGre of Canudas de Wit et al. 1995: bristles that yield at every speed"\n',
            'rational = "mu f_n slope v / (1 + slope v)"\n',
        )
    ],
}
ROOF = '''

@entry(SMOOTH, "Roof along x", {**PLANE, "pitch": SLOPE})
def roof(values: SimpleNamespace) -> Surface:
    """Returns two planes that meet at x = 0 and fall to both sides."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    return _surface("roof", x, y, cell, -values.pitch * np.abs(x))
'''


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of what the recipes change, and the package in which models/ is the copy's."""
    for folder in ("models", "plant_fmu"):
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=unwanted)
    package = tmp_path / "links" / "hexapod_cosim"
    package.mkdir(parents=True)
    for part in ("controller", "cosim", "extensions"):
        (package / part).symlink_to(ROOT / part)
    (package / "models").symlink_to(tmp_path / "models")
    (package / "__init__.py").symlink_to(ROOT / "packaging" / "hexapod_cosim" / "__init__.py")
    return tmp_path


def write_below(path: Path, above: str, text: str) -> None:
    before = path.read_text(encoding="utf-8")
    assert before.count(above) == 1
    path.write_text(before.replace(above, above + text), encoding="utf-8")


def ask(copy: Path, code: str) -> str:
    """Returns the last line that Python prints of code, with the copy's models/."""
    command = [sys.executable, "-c", FROM_THE_COPY + code]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().rpartition("\n")[2]


def test_a_friction_law_that_is_added_by_its_recipe_has_its_force_in_both_languages(
    copy: Path,
) -> None:
    """mu f_n k_t v / (1 + k_t v) with mu = 0.5, f_n = 10 N, k_t = 100 s/m at v = 0.03 m/s."""
    written = set(FRICTION) | {"docs/equations.md"}
    assert written == set(dict(RECIPES)["lugre"].split(", "))
    for name, texts in FRICTION.items():
        for above, text in texts:
            write_below(copy / name, above, text)
    code = """
import numpy as np
from dataclasses import replace
from hexapod_cosim.models import FRICTION_LAWS, load_robot
from hexapod_cosim.models.friction import friction_force
own = load_robot("athena").friction
law = replace(own, law="rational", mu=0.5, mu_static=0.0, slope=100.0, viscous=0.0)
print(FRICTION_LAWS[-1], friction_force(law, 10.0, np.array([0.03, 0.0, 0.0]))[0])
"""
    assert ask(copy, code) == "rational -3.75"  # N
    table = tomllib.loads((copy / "plant_fmu" / "interface.toml").read_text(encoding="utf-8"))
    items = [name for name in table["enumeration"]["FrictionLaw"] if name != "prefix"]
    assert items[-1] == "rational"
    assert compiled_drag(copy, law=len(items), slope=100.0, speed=0.03) == 25.0  # s/m, 3.75/(5 v)


def compiled_drag(copy: Path, *, law: int, slope: float, speed: float) -> float:
    """g(v) of the copy's lanes/friction.h, for a law by its number."""
    (copy / "ask.c").write_text(
        '#include "lanes/friction.h"\n'
        "double ask(int law, double slope, double speed) {\n"
        "  static hxModel model;\n"
        "  model.friction_law = law, model.slope = slope;\n"
        "  double drag[HX_LANES];\n"
        "  hx_store(drag, hx_friction_direction(&model, hx_splat(speed)));\n"
        "  return drag[0];\n}\n",
        encoding="utf-8",
    )
    sources = [copy / "ask.c", copy / "plant_fmu" / "src" / "elementary.c"]
    includes = [f"-I{copy / 'plant_fmu' / name}" for name in ("src", "include")]
    number = f"-DHX_FRICTION_RATIONAL={law}"  # as `make generate` numbers it
    command = ["cc", "-std=c11", "-shared", "-fPIC", number, *includes, "-o", str(copy / "ask.so")]
    subprocess.run([*command, *map(str, sources), "-lm"], check=True)
    library = ctypes.CDLL(str(copy / "ask.so"))
    library.ask.restype = ctypes.c_double
    library.ask.argtypes = [ctypes.c_int, ctypes.c_double, ctypes.c_double]
    return float(library.ask(law, slope, speed))


def test_a_terrain_that_is_added_by_its_recipe_can_be_walked_on(
    plant_build: Path, copy: Path
) -> None:
    path = copy / "models" / "ground" / "rough.py"
    path.write_text(path.read_text(encoding="utf-8") + ROOF, encoding="utf-8")
    words = [*("simulate", "walk_flat", "-o", "out"), *QUICK]
    words += settings("terrain.kind=roof", "terrain.pitch=0.25")
    code = f"from hexapod_cosim.cosim.cli import main\nassert main({words}) == 0\n"
    code += """
from pathlib import Path
import numpy as np
from hexapod_cosim.cosim.results.folder import read_result
from hexapod_cosim.models.ground.faces import surface_heights
surface = read_result(Path("out")).view.surface
heights = surface_heights(surface, np.array([-0.4, 0.0, 0.4]), np.zeros(1))
print(surface.name, *heights.ravel().tolist())
"""
    name, *heights = ask(copy, code).split()
    assert name == "roof"
    assert [float(one) for one in heights] == pytest.approx([-0.1, 0.0, -0.1], abs=1e-12)
