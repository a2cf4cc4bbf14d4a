"""The arrows between the folders: models <- controller <- cosim; src of the components sees no
FMI, fmi nothing of src. The C files of the FMI layer call each other in one direction only.
"""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

import pytest
from pages import COMMANDS, parsed

from hexapod_cosim.cosim.common.plant_files import SHARED_HEADERS

ROOT = Path(__file__).parents[2]
PACKAGE = "hexapod_cosim"
SEES = {
    "models": {"models"},
    "controller": {"models", "controller"},
    "cosim": {"models", "controller", "cosim"},
    "extensions": {"models", "controller", "cosim", "extensions"},
}
# what each room of cosim and of controller may import, besides the files beside the rooms
LOW = ["common", "interface", "scenario", "master"]
RUNNING = [*LOW, "control", "export", "logs", "results", "design"]
ROOMS = {
    "common": [],
    "interface": LOW[:1],
    "scenario": LOW[:2],
    "master": LOW[:3],
    "control": LOW,
    "export": LOW,
    "logs": LOW,
    "results": [*LOW, "logs"],
    "design": [*LOW, "export"],
    "report": [*LOW, "export", "results"],
    "run": RUNNING,
}
CONTROL_ROOMS = {
    "walk": [],
    "sense": ["walk"],
    "comply": ["walk", "sense"],
    "design": ["walk", "sense", "comply"],
}
# what each folder of plant_fmu/src may include, besides the files beside the folders
PLANT_FOLDERS: dict[str, list[str]] = {
    "packs": [],
    "ground": ["packs"],
    "lanes": ["packs", "ground"],
    "measure": ["packs", "ground", "lanes"],
    "kernels": ["packs", "ground", "lanes", "measure"],
    "command": [],
    "robot": ["ground"],
    "plant": ["ground", "command", "robot"],
}
# the components of FMUs; an extension may have been deleted
POLICY = "extensions/gym/policy_fmu"
COMPONENTS = ("plant_fmu", "controller/fmu", *([POLICY] if (ROOT / POLICY).is_dir() else []))
# third-party packages by folder; cosim may use what pyproject lists
MAY_USE = {
    "models": {"numpy", "PIL"},
    "controller": {"numpy", "scipy", "control", "matplotlib"},
    "extensions/gym": {"numpy", "gymnasium", "typer"},
}
RUN_TIME_ONLY = {"numpy", "scipy"}  # of the controller outside controller/design
INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]', re.MULTILINE)
STANDARD_C = {
    "float.h",
    "math.h",
    "stdarg.h",
    "stddef.h",
    "stdint.h",
    "stdio.h",
    "stdlib.h",
    "string.h",
    "stdbool.h",
    "limits.h",
}
TICKED = re.compile(r"`([\w.]+)`")
INTRINSICS = {"immintrin.h"}  # of the compiler


def python_files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


@cache
def imports(path: Path) -> list[str]:
    """Dotted names of all modules a file imports, wherever in it."""
    names = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            names.append(node.module or "")
    return names


@pytest.mark.parametrize("folder", SEES)
def test_a_folder_imports_only_what_lies_below_it(folder: str) -> None:
    for path in python_files(folder):
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == PACKAGE:
                assert len(parts) > 1, f"{path.relative_to(ROOT)} imports the bare {PACKAGE}"
                assert parts[1] in SEES[folder], f"{path.relative_to(ROOT)} imports {name}"


@pytest.mark.parametrize(("folder", "rooms"), [("cosim", ROOMS), ("controller", CONTROL_ROOMS)])
def test_a_room_imports_only_the_rooms_below_it(folder: str, rooms: dict[str, list[str]]) -> None:
    seen = set()
    for path in python_files(folder):
        parts = path.relative_to(ROOT / folder).with_suffix("").parts
        if len(parts) == 1 or parts[0] == "cli" or parts[-1] == "__init__":
            continue
        room = parts[0]
        seen.add(room)
        for name in imports(path):
            package, _, inner = name.partition(f"{PACKAGE}.{folder}.")
            other = inner.split(".")[0]
            if not package and (ROOT / folder / other).is_dir():
                assert other == room or other in rooms[room], (
                    f"{path.relative_to(ROOT)} imports {name}"
                )
    assert seen == set(rooms)


def test_a_folder_of_the_plant_includes_only_the_folders_below_it() -> None:
    source, seen = ROOT / "plant_fmu" / "src", set()
    for path in sorted(source.glob("*/*.[ch]")):
        folder = path.parent.name
        seen.add(folder)
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            beside = (path.parent / name).resolve()
            other = beside.parent.name if beside.is_file() else ""
            if other and beside.parent != source:
                assert other == folder or other in PLANT_FOLDERS[folder], (
                    f"{path.relative_to(ROOT)} includes {name}"
                )
    assert seen == set(PLANT_FOLDERS)


def test_an_extension_imports_no_other() -> None:
    for path in python_files("extensions"):
        own = path.relative_to(ROOT / "extensions").parts[0]
        for name in imports(path):
            if name.startswith(f"{PACKAGE}.extensions."):
                assert name.split(".")[2] == own, f"{path.relative_to(ROOT)} imports {name}"


def documented_modules() -> set[str]:
    """Returns the modules of the core that docs/architecture.md opens to extensions."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)`[^|]*\|[^|]*\|([^|]*)\|$", page, re.MULTILINE)
    found = {f"cosim.{room}.{name}" for room, names in rows for name in TICKED.findall(names)}
    (text,) = re.findall(r"^They use the core's modules.*?; a test", page, re.MULTILINE | re.DOTALL)
    folder = ""
    for name in TICKED.findall(text):
        if name.startswith(PACKAGE):
            folder = name.removeprefix(f"{PACKAGE}.")
        found.add(folder if name.startswith(PACKAGE) else f"{folder}.{name}")
    return found


def test_extensions_use_the_documented_modules_of_the_core() -> None:
    names = {name for path in python_files("extensions") for name in imports(path)}
    below = (f"{PACKAGE}.models", f"{PACKAGE}.controller", f"{PACKAGE}.cosim")
    used = {name.removeprefix(f"{PACKAGE}.") for name in names if name.startswith(below)}
    documented = documented_modules()
    assert used <= documented, f"{used - documented} are no modules for extensions"
    if all((ROOT / "extensions" / name).is_dir() for name in COMMANDS):
        assert documented == used  # what none uses is listed in vain


@pytest.mark.parametrize("folder", MAY_USE)
def test_a_folder_uses_only_the_packages_it_may(folder: str) -> None:
    for path in python_files(folder):
        allowed = (
            RUN_TIME_ONLY
            if folder == "controller" and "design" not in path.relative_to(ROOT).parts
            else MAY_USE[folder]
        )
        foreign = (
            {name.split(".")[0] for name in imports(path)}
            - set(sys.stdlib_module_names)
            - {PACKAGE}
        )
        assert foreign <= allowed, f"{path.relative_to(ROOT)} imports {sorted(foreign - allowed)}"


def test_no_folder_is_imported_under_a_second_name() -> None:
    files = [
        path
        for folder in (*SEES, "tests", "examples", "tools", "benchmarks")
        for path in python_files(folder)
    ]
    assert files
    for path in files:
        second = {name for name in imports(path) if name.split(".")[0] in SEES}
        assert not second, (
            f"{path.relative_to(ROOT)} imports {sorted(second)}: a copy of {PACKAGE}'s"
        )


def c_files(*folders: str, component: str = "plant_fmu") -> list[Path]:
    """The C sources and headers of folders of a component and of the folders in them; "" is the
    component's folder without those in it.
    """
    root = ROOT / component
    found = [
        path
        for folder in folders
        for path in ((root / folder).rglob("*.[ch]") if folder else root.glob("*.[ch]"))
    ]
    return sorted(set(found))


@pytest.mark.parametrize("component", COMPONENTS)
def test_a_core_includes_itself_its_header_and_the_c_library(component: str) -> None:
    folders = ("src", "include/hexapod")
    own = {path.name for path in c_files("src", component=component)}
    public = {
        "plant_fmu": {
            path.relative_to(ROOT / "plant_fmu/include/hexapod").as_posix()
            for path in c_files("include/hexapod")
        },
        "controller/fmu": {*("controller.h", "generated/controller_settings.h", *SHARED_HEADERS)},
        POLICY: {"policy.h", "torso_axes.h", *SHARED_HEADERS},
    }
    own |= {f"hexapod/{name}" for name in public[component]}
    files = c_files(*folders, component=component)
    assert files
    for path in files:
        included = {
            name if name.startswith("hexapod/") else Path(name).name
            for name in INCLUDE.findall(path.read_text(encoding="utf-8"))
        }
        foreign = included - own - STANDARD_C - INTRINSICS
        assert not foreign, f"{path.relative_to(ROOT)} includes {sorted(foreign)}"


@pytest.mark.parametrize("component", COMPONENTS)
def test_the_fmi_layer_includes_no_core(component: str) -> None:
    core = {path.name for path in c_files("src", component=component)}
    files = [*c_files("fmi", component="."), *c_files("generated", component=component)]
    assert files
    for path in files:
        included = set(INCLUDE.findall(path.read_text(encoding="utf-8")))
        inside = {
            name
            for name in included
            if Path(name).name in core and not name.startswith(("fmi/", "hexapod/"))
        }
        assert not inside, f"{path.relative_to(ROOT)} includes {sorted(inside)}"


@pytest.mark.parametrize(
    ("component", "more"), [("cosim/master", ""), ("extensions/gym/loop", "cosim/master")]
)
def test_the_loops_see_the_standard_and_nothing_of_the_fmus_they_drive(
    component: str, more: str
) -> None:
    files = c_files("src", "include/hexapod", component=component)
    if not files:
        pytest.skip("the extension is not there")
    below = c_files("include/hexapod", component=more) if more else []
    headers = [path for path in (*files, *below) if path.suffix == ".h"]
    own = {path.name for path in headers} | {f"hexapod/{path.name}" for path in headers}
    shared = ("shared_work.h", "status.h", "message.h", "torso_axes.h")
    own |= {f"hexapod/{name}" for name in shared}
    for path in files:
        included = set(INCLUDE.findall(path.read_text(encoding="utf-8")))
        foreign = included - own - {"fmi2FunctionTypes.h"} - STANDARD_C
        assert not foreign, f"{path.relative_to(ROOT)} includes {sorted(foreign)}"


@pytest.mark.parametrize("component", COMPONENTS)
def test_only_the_fmi_layer_names_the_standard(component: str) -> None:
    for path in c_files("src", "include/hexapod", component=component):
        assert not re.search(r"\bfmi[23][A-Z]", path.read_text(encoding="utf-8")), (
            f"{path.relative_to(ROOT)} names an FMI type or function"
        )


# Tests that the C files of the FMI layer call each other in one direction only; fmi/instance.h
# describes the layers.

FMI = Path(__file__).resolve().parents[2] / "fmi"
# from the bottom up; files of one layer do not call each other
LAYERS = (
    ("variables",),
    ("resources",),
    ("instance",),
    ("step", "exchange", "state"),
    ("call", "arrays"),
    ("fmi2", "fmi3"),
)
LAYER_OF = {name: index for index, layer in enumerate(LAYERS) for name in layer}
DEFINITION = re.compile(r"^(?!static|extern)[\w *]*\b(hx_\w+)\([^;{]*\) \{", re.MULTILINE)
CALL = re.compile(r"\b(hx_\w+)\b")


def defined_in() -> dict[str, str]:
    """Returns the file that defines each function."""
    return {
        function: name
        for name in LAYER_OF
        for function in DEFINITION.findall((FMI / f"{name}.c").read_text(encoding="utf-8"))
    }


def test_every_c_file_has_a_layer() -> None:
    assert {path.stem for path in FMI.glob("*.c")} == set(LAYER_OF)


@pytest.mark.parametrize("name", LAYER_OF)
def test_a_file_calls_only_the_layers_below_it(name: str) -> None:
    definitions = defined_in()
    assert definitions["hx_log"] == "variables"
    assert definitions["hx_instance_step"] == "step"
    text = (FMI / f"{name}.c").read_text(encoding="utf-8")
    for function in set(CALL.findall(text)):
        other = definitions.get(function, name)
        below = LAYER_OF[other] < LAYER_OF[name]
        assert other == name or below, f"{name}.c calls {function} of {other}.c"
