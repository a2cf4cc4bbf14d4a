"""Checks for a working C compiler before the build, and reports a missing one in one paragraph.

CMake would report it too, but only after pip has downloaded CMake, and in many lines.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

USUAL = ("cc", "gcc", "clang")
USUAL_WINDOWS = ("cl", "clang-cl", "gcc", "clang")
# the program with which CMake finds Visual Studio
VSWHERE = Path("Microsoft Visual Studio") / "Installer" / "vswhere.exe"
# settings of CMake with which the user chooses a compiler
COMPILER_SETTINGS = ("CMAKE_C_COMPILER", "TOOLCHAIN")
PROGRAM = (
    "#include <math.h>\n#include <stdio.h>\n"
    "int main(int n, char **v) { return printf(v[0], sqrt(n)) < 0; }\n"
)
FIXES = {
    "darwin": "install Apple's command line tools with `xcode-select --install`",
    "win32": (
        'install the Build Tools for Visual Studio with "Desktop development with C++", or '
        "MinGW-w64 in PATH"
    ),
    "linux": (
        "install one (Debian, Ubuntu: `apt-get install gcc libc6-dev`; Fedora: "
        "`dnf install gcc`; Arch: `pacman -S gcc`; Alpine: `apk add gcc musl-dev`)"
    ),
}
OWN = "or name yours with CC=/path/to/compiler"

Settings = Mapping[str, Any] | None


class CompilerError(SystemExit):
    """There is no compiler; ends the build with one paragraph, without a traceback."""


def require_compiler(settings: Settings = None) -> None:
    """Checks that there is a working C compiler and sets CC to it. Raises CompilerError.

    settings: pip's --config-settings. A compiler or toolchain file in them or in CMake's
    environment variables is not checked.
    """
    texts = [
        *map(str, (settings or {}).keys()),
        *map(str, (settings or {}).values()),
        os.environ.get("CMAKE_ARGS", ""),
    ]
    texts += [
        f"{name}={value}"
        for name, value in os.environ.items()
        if name.startswith(("CMAKE_", "SKBUILD_CMAKE"))
    ]
    if (
        any(word in text.upper() for text in texts for word in COMPILER_SETTINGS)
        or _visual_studio()
    ):
        return
    tried = {" ".join(words): _fault(words) for words in _candidates()}
    works = [name for name, fault in tried.items() if fault == ""]
    if not works:
        raise CompilerError(
            _paragraph(
                {name: fault for name, fault in tried.items() if fault is not None}, list(tried)
            )
        )
    if sys.platform != "win32":
        os.environ.setdefault("CC", works[0])


def _candidates() -> list[list[str]]:
    """Returns the compiler commands to try, in order; CC only where it is set, since the build
    uses no other.
    """
    if given := shlex.split(os.environ.get("CC", "")):
        return [given]
    if sys.platform == "win32":
        return [[name] for name in USUAL_WINDOWS]
    own = shlex.split(sysconfig.get_config_var("CC") or "")[:1]
    return (
        [own, *([name] for name in USUAL if [name] != own)] if own else [[name] for name in USUAL]
    )


def _visual_studio() -> bool:
    """Returns whether Visual Studio is installed."""
    return sys.platform == "win32" and any(
        (Path(os.environ[name]) / VSWHERE).is_file()
        for name in ("ProgramFiles(x86)", "ProgramFiles")
        if name in os.environ
    )


def _fault(command: list[str]) -> str | None:
    """Returns a compiler's error for a small program, "" if it succeeds; None without the
    compiler.
    """
    if shutil.which(command[0]) is None:
        return None
    if sys.platform == "win32":
        return ""  # it needs the environment that CMake sets up
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "program.c"
        source.write_text(PROGRAM, encoding="utf-8")
        words = [*command, str(source), "-o", str(source.with_suffix("")), "-lm"]
        english = os.environ | {"LC_ALL": "C"}
        done = subprocess.run(
            words, capture_output=True, text=True, errors="replace", check=False, env=english
        )
    if done.returncode == 0:
        return ""
    lines = (done.stderr + done.stdout).splitlines()
    errors = [line.strip() for line in lines if "error" in line.lower()]
    return errors[0] if errors else "no error message"


def _paragraph(broken: Mapping[str, str], looked_for: list[str]) -> str:
    """Returns the message: got, expected and what to do on this platform."""
    names = (
        f"{', '.join(looked_for[:-1])} and {looked_for[-1]}"
        if len(looked_for) > 1
        else looked_for[0]
    )
    got = (
        "; ".join(f"{name} is there but fails: {fault}" for name, fault in broken.items())
        or "none in PATH"
    )
    fix = FIXES.get(sys.platform, FIXES["linux"])
    return (
        f"no C compiler: looked for {names}, got {got}; expected one that compiles and links "
        "a C program with the standard library, since the plant and the controller are built "
        f"from C; {fix}, {OWN}"
    )
