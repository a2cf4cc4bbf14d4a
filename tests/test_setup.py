"""The set-up says what is missing before it does anything."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_a_missing_compiler_is_said_in_a_line_before_anything_is_made(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("make", "sh", "python3", "find", "touch", "mkdir"):
        program = shutil.which(name)
        assert program is not None
        (tools / name).symlink_to(program)
    venv = tmp_path / "venv"
    done = subprocess.run(
        ["make", "setup", f"VENV={venv}"], cwd=ROOT, capture_output=True, text=True, check=False, env={"PATH": str(tools)}
    )
    assert done.returncode != 0
    assert "no C compiler: looked for cc, gcc and clang, found none; install one" in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert not venv.exists()
