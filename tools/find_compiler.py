"""Looks for a C compiler before anything is built, so that a machine without one is told at once
and in words.

CMake would say it too, after pip has fetched it, on many lines and about CC=gcc, which
scikit-build-core takes from how Python was built.
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
VSWHERE = (
    Path("Microsoft Visual Studio") / "Installer" / "vswhere.exe"
)  # finds Visual Studio for CMake
TOLD_OTHERWISE = (
    "CMAKE_C_COMPILER",
    "TOOLCHAIN",
)  # in settings of CMake: the user says what compiles
PROGRAM = (
    "#include <math.h>\n#include <stdio.h>\nint main(int n, char **v) { return printf(v[0], "
    "sqrt(n)) < 0; }\n"
)
FIXES = {
    "darwin": "install Apple's command line tools with `xcode-select --install`",
    "win32": (
        'install the Build Tools for Visual Studio with "Desktop development with C++", or '
        "MinGW-w64 in PATH"
    ),
    "linux": (
        "install one (Debian, Ubuntu: `apt-get install gcc libc6-dev`; Fedora: `dnf install "
        "gcc`; Arch: `pacman -S gcc`; "
        "Alpine: `apk add gcc musl-dev`)"
    ),
}
OWN = "or name yours with CC=/path/to/compiler"

Settings = Mapping[str, Any] | None


class CompilerError(SystemExit):
    """No compiler; ends the build with one paragraph, without a traceback."""


def require_compiler(settings: Settings = None) -> None:
    """Sees that there is a C compiler that works, and tells the build which one. Raises
    CompilerError.

    settings: pip's --config-settings; a compiler or a toolchain file named in them, or in CMake's
    variables, is believed.
    """
    told = [
        *map(str, (settings or {}).keys()),
        *map(str, (settings or {}).values()),
        os.environ.get("CMAKE_ARGS", ""),
    ]
    told += [
        f"{name}={value}"
        for name, value in os.environ.items()
        if name.startswith(("CMAKE_", "SKBUILD_CMAKE"))
    ]
    if any(word in text.upper() for text in told for word in TOLD_OTHERWISE) or _visual_studio():
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
    """Commands in the order in which they are tried: CC alone where it is set, for the build
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
    return sys.platform == "win32" and any(
        (Path(os.environ[name]) / VSWHERE).is_file()
        for name in ("ProgramFiles(x86)", "ProgramFiles")
        if name in os.environ
    )


def _fault(command: list[str]) -> str | None:
    """What keeps a compiler from making a small program, "" when nothing does; None when there
    is no such compiler.
    """
    if shutil.which(command[0]) is None:
        return None
    if sys.platform == "win32":
        return ""  # it compiles in an environment of its own
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "program.c"
        source.write_text(PROGRAM, encoding="utf-8")
        words = [*command, str(source), "-o", str(source.with_suffix("")), "-lm"]
        english = os.environ | {"LC_ALL": "C"}
        done = subprocess.run(
            words, capture_output=True, text=True, errors="replace", check=False, env=english
        )
    lines = [
        line for line in (done.stderr + done.stdout).splitlines() if "error" in line.lower()
    ] or ["no word why"]
    return lines[0].strip() if done.returncode else ""


def _paragraph(broken: Mapping[str, str], looked_for: list[str]) -> str:
    """Got, expected and what to do on this platform."""
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
        "a C program with the standard library, "
        f"for the plant and the controller are built from C; {fix}, {OWN}"
    )
