"""Makes a virtual environment with pip, also where the system's Python comes without it (Debian
keeps it in python3-venv).

usage: python3 tools/make_venv.py FOLDER

Needs the standard library only. An environment that is there and works is left as it is.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request
import venv
from pathlib import Path

OLDEST = (3, 11)
INDEX = os.environ.get("PIP_INDEX_URL", "https://pypi.org/simple").rstrip("/")
WHEEL = re.compile(
    r'href="([^"#]*pip-([0-9.]+)-py3-none-any\.whl)#sha256=([0-9a-f]{64})"'
)  # address, release, checksum


def main() -> int:
    """Makes it; returns the exit code."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    if sys.version_info[:2] < OLDEST:
        found, needed = (".".join(map(str, version)) for version in (sys.version_info[:2], OLDEST))
        print(
            f"Python too old: got {found}, expected {needed} or later; run make with PYTHON=/path/to/python3",
            file=sys.stderr,
        )
        return 1
    folder = Path(sys.argv[1])
    if not has_pip(folder):
        make(folder)
    return 0


def has_pip(folder: Path) -> bool:
    """Whether the environment's Python runs and has pip."""
    python = folder / "bin" / "python"
    return (
        python.exists()
        and subprocess.run(
            [python, "-m", "pip", "--version"], capture_output=True, check=False
        ).returncode
        == 0
    )


def make(folder: Path) -> None:
    """An environment with pip: the system's own copy, or else the newest one of the package
    index.
    """
    shutil.rmtree(folder, ignore_errors=True)
    try:
        venv.create(folder, with_pip=True, symlinks=True)
    except (subprocess.CalledProcessError, ImportError):
        venv.create(folder, with_pip=False, symlinks=True, clear=True)
        install_pip(folder)


def install_pip(folder: Path) -> None:
    """pip from the index, installed by itself: its wheel runs as it is."""
    with tempfile.TemporaryDirectory() as temporary:
        wheel = download_pip(Path(temporary))
        subprocess.run(
            [folder / "bin" / "python", wheel / "pip", "install", "--quiet", "--no-index", wheel],
            check=True,
        )


def download_pip(folder: Path) -> Path:
    """The newest release of pip as a wheel, its checksum verified."""
    page = f"{INDEX}/pip/"
    with urllib.request.urlopen(page) as answer:
        links = WHEEL.findall(answer.read().decode("utf-8"))
    link, release, checksum = max(
        links, key=lambda found: [int(part) for part in found[1].split(".")]
    )
    with urllib.request.urlopen(urllib.parse.urljoin(page, link)) as answer:
        content = answer.read()
    if hashlib.sha256(content).hexdigest() != checksum:
        raise SystemExit(f"{link}: damaged on the way; try again")
    wheel = folder / f"pip-{release}-py3-none-any.whl"
    wheel.write_bytes(content)
    return wheel


if __name__ == "__main__":
    sys.exit(main())
