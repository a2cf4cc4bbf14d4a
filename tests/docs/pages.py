"""Pages of documentation as their readers take them: blocks of code, the commands in them, and
what these do in a folder; and syntax trees of the repository's Python.
"""

from __future__ import annotations

import ast
import io
import os
import re
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path

from hexapod_cosim.cosim.cli import main

EXTENSIONS = Path(__file__).resolve().parents[2] / "extensions"
COMMANDS = {  # of each extension
    "study": {"study"},
    "identify": {"identify", "replay"},
    "course": {"benchmark"},
    "live": {"live", "realtime"},
    "gym": {"gym"},
}
# the beginnings of commands of extensions that were deleted
MISSING = [
    f"hexapod {command}"
    for name, commands in COMMANDS.items()
    if not (EXTENSIONS / name).is_dir()
    for command in commands
]


@cache
def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file, which several tests of this room look at."""
    return ast.parse(path.read_text(encoding="utf-8"))


def blocks(page: Path) -> list[tuple[str, str]]:
    """Kind and text of a page's code."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"```([\w{}-]*)[^\n]*\n(.*?)```", text, flags=re.DOTALL)


def commands(page: Path, program: str) -> list[str]:
    """The lines of plain blocks that call a program, without their comments."""
    lines = [
        line.split("#")[0].strip()
        for kind, text in blocks(page)
        if not kind
        for line in text.splitlines()
    ]
    missing = MISSING if program.split(maxsplit=1)[0] == "hexapod" else ()
    return [
        line
        for line in lines
        if line.startswith(program + " ") and not line.startswith(tuple(missing))
    ]


def typed(folder: Path, program: str, *words: str) -> str:
    """Runs a command in a folder and returns its output; fails with what it printed.

    The hexapod command runs in this process, which has imported and exported already what each
    process of its own would import and export again.
    """
    if program != "hexapod":
        return run(folder, program, *words)
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    assert code == 0, err.getvalue() + out.getvalue()
    return out.getvalue()


def run(folder: Path, *arguments: str) -> str:
    """Runs a program of this environment in a folder; fails with what it printed."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        arguments,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PATH": path},
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout
