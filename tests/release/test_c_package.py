"""The plant as a C library: built from its folder alone, installed, and used by a program
elsewhere, as C people expect.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pages import blocks

ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
EXAMPLE = ROOT / "examples" / "c_library"
STRICT = "-std=c11 -Wall -Wextra -Wpedantic -Werror"
SAYS = [
    "stands   6 feet on the ground carry 59.841 N",
    "lifts    5 feet on the ground carry 59.84",
    "pushed   6 feet on the ground",
]
PATH = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
CMAKE = shutil.which("cmake", path=PATH) or "cmake"
NINJA = ["-G", "Ninja"] if shutil.which("ninja", path=PATH) else []


def done(*command: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    return subprocess.run(
        words,
        env=os.environ | {"PATH": PATH} | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def output(*command: str | Path, **variables: str) -> str:
    """What a command that must succeed prints."""
    process = done(*command, **variables)
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def vendored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant in another tree, with the licence and without the Python project."""
    folder = tmp_path_factory.mktemp("vendor") / "hexapod"
    shutil.copytree(ROOT / "plant_fmu", folder)
    shutil.copy(ROOT / "LICENSE", folder)
    return folder


@pytest.fixture(scope="module")
def prefix(vendored: Path) -> Path:
    """Where it is installed; it is moved there afterwards, since an installation may be."""
    build, first, moved = (vendored.parent / name for name in ("build", "first", "moved"))
    output(CMAKE, "-S", vendored, "-B", build, *NINJA, "-DCMAKE_BUILD_TYPE=Debug", "-DHX_LINT=ON")
    output(CMAKE, "--build", build)
    output(CMAKE, "--install", build, "--prefix", first)
    first.rename(moved)
    return moved


def test_the_installation_is_what_c_people_expect(prefix: Path) -> None:
    files = {path.relative_to(prefix).as_posix() for path in prefix.rglob("*") if not path.is_dir()}
    headers = {path for path in files if path.startswith("include/")}
    assert headers == {
        f"include/hexapod/{name}.h"
        for name in ("generated/plant_settings", "hexapod", "legs", "status", "terrain")
    }
    assert "share/doc/hexapod/LICENSE" in files
    assert any(path.endswith("/cmake/hexapod/hexapodConfigVersion.cmake") for path in files)
    for path in files:
        if path.endswith((".cmake", ".pc")):
            assert str(prefix.parent) not in (prefix / path).read_text(encoding="utf-8"), (
                f"{path} knows where it was installed"
            )


def test_a_program_elsewhere_finds_it_by_find_package(prefix: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "program")
    build = tmp_path / "build"
    output(
        CMAKE,
        "-S",
        tmp_path / "program",
        "-B",
        build,
        *NINJA,
        f"-DCMAKE_PREFIX_PATH={prefix}",
        f"-DCMAKE_C_FLAGS={STRICT}",
    )
    output(CMAKE, "--build", build)
    printed = output(build / "step")
    assert all(text in printed for text in SAYS), printed


def test_a_program_elsewhere_finds_it_by_pkg_config(prefix: Path, tmp_path: Path) -> None:
    if shutil.which("pkg-config") is None:
        pytest.skip("no pkg-config")
    (folder,) = prefix.rglob("pkgconfig")
    flags = output(
        "pkg-config", "--cflags", "--libs", "hexapod-plant", PKG_CONFIG_PATH=str(folder)
    ).split()
    output("cc", *STRICT.split(), EXAMPLE / "step.c", *flags, "-o", tmp_path / "step")
    printed = output(
        tmp_path / "step", LD_LIBRARY_PATH=str(folder.parent), DYLD_LIBRARY_PATH=str(folder.parent)
    )
    assert all(text in printed for text in SAYS), printed
    assert (
        output("pkg-config", "--modversion", "hexapod-plant", PKG_CONFIG_PATH=str(folder)).strip()
        == VERSION
    )


def test_the_program_of_the_page_works_as_it_stands(prefix: Path, tmp_path: Path) -> None:
    (code,) = (
        text for kind, text in blocks(ROOT / "docs" / "howto" / "c-library.md") if kind == "c"
    )
    (tmp_path / "mine.c").write_text(code, encoding="utf-8")
    (library,) = prefix.rglob("libhexapod_c.*[yo]")  # .so, .dylib
    flags = [
        "-DHX_SHARED",
        f"-I{prefix / 'include'}",
        f"-L{library.parent}",
        "-lhexapod_c",
        f"-Wl,-rpath,{library.parent}",
    ]
    output("cc", *STRICT.split(), tmp_path / "mine.c", *flags, "-o", tmp_path / "mine")
    assert output(tmp_path / "mine") == "after 1 s the feet carry 54.936 N\n"


def test_the_library_fits_into_another_project_and_installs_nothing_there(
    vendored: Path, tmp_path: Path
) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\n"
        "project(theirs VERSION 9.9 LANGUAGES C)\n"
        f"add_subdirectory({vendored.as_posix()} hexapod EXCLUDE_FROM_ALL)\n"
        f"add_library(step OBJECT {EXAMPLE.as_posix()}/step.c)\n"
        "target_link_libraries(step PRIVATE hexapod::plant)\n",
        encoding="utf-8",
    )
    build = tmp_path / "build"
    output(CMAKE, "-S", tmp_path, "-B", build, *NINJA, "-DCMAKE_BUILD_TYPE=Debug")
    output(CMAKE, "--build", build)
    output(CMAKE, "--install", build, "--prefix", tmp_path / "installed")
    assert not list((tmp_path / "installed").rglob("*"))
