"""Builds the release: a wheel for each platform, the source distribution and their SHA-256 list.

    python -m tools.wheels [FOLDER]                 all of them, in dist/ by default

The folder has the source distribution and the one wheel that fits this machine, so that
`pip install dist/*.whl` works; the wheels of other machines are in its folder other_platforms.

Every wheel is made of the same files: those of the wheel that this machine builds from the source
distribution, without its binaries and C libraries, and the cross-compiled binaries of all FMUs
for all platforms. A wheel differs from another one by its co-simulation loop and its tag alone, so
that `hexapod export --platforms all` needs no compiler. The same sources and the same ziglang give
the same bytes.

The binaries for glibc run on musl too: musl's loader takes itself for libc.so.6 and libm.so.6, and
they require no function that musl lacks (tests/release/test_wheels.py). The wheels for Linux
therefore have the tags of both.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from packaging.tags import platform_tags
from rich.console import Console
from wheel.wheelfile import WheelFile, get_zipinfo_datetime

from hexapod_cosim.cosim.cli.extension import extensions_in, loaded
from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.common.plant_files import fmi_headers, loop_folders
from hexapod_cosim.cosim.export.cross_build import TARGETS, Library, build_library
from hexapod_cosim.cosim.export.platforms import component_library

ROOT = Path(__file__).parents[1]
BINARIES, LIBRARIES = "hexapod_cosim/plant/binaries/", "hexapod_cosim/plant/lib/"
BEST = 9  # level of compression
LARGEST = 5_000_000  # bytes of a wheel
OTHERS = "other_platforms"  # folder of the wheels that do not fit this machine


@dataclass(frozen=True)
class Platform:
    """A wheel's target of the cross compiler and the platform part of its tag."""

    target: str
    tag: str

    @property
    def fits(self) -> bool:
        """Whether this machine can install the wheel."""
        return not set(self.tag.split(".")).isdisjoint(platform_tags())


LINUX = "manylinux_2_17_{0}.manylinux2014_{0}.musllinux_1_1_{0}"
PLATFORMS = (
    Platform("x86_64-linux", LINUX.format("x86_64")),
    Platform("aarch64-linux", LINUX.format("aarch64")),
    Platform("x86_64-windows", "win_amd64"),
    Platform("x86_64-darwin", "macosx_11_0_x86_64"),
    Platform("aarch64-darwin", "macosx_11_0_arm64"),
)


def main(folder: Path) -> None:
    """Builds the release into a folder and reports the size of each file."""
    console = Console()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.rglob("*.whl"):  # a release before may have put them elsewhere
        old.unlink()
    os.environ.setdefault("SOURCE_DATE_EPOCH", commit_time())
    with console.status("building the wheel of this machine and the source distribution"):
        source, base = build_source(folder)
    with console.status("compiling for all platforms (minutes, the first time)"):
        binaries = cross_compile()
    for extension in extensions_in(ROOT):
        for name, place in extension.release.items():
            base[f"hexapod_cosim/plant/{name}"] = loaded(place)()
    base |= bill_of_materials(base)
    wheels = [
        write_wheel(base, platform, binaries, folder if platform.fits else folder / OTHERS)
        for platform in PLATFORMS
    ]
    write_hashes(folder, [source, *wheels])
    for path in (source, *wheels):
        console.print(f"{path.stat().st_size / 1e6:5.2f} MB  {path.name}", highlight=False)
    large = [path.name for path in wheels if path.stat().st_size > LARGEST]
    if large:
        sys.exit(f"wheels of more than {LARGEST / 1e6:.0f} MB: {', '.join(large)}")


def commit_time() -> str:
    """Returns the time of the last commit in seconds, which all files of the release have."""
    command = ["git", "log", "-1", "--format=%ct"]
    return subprocess.check_output(command, cwd=ROOT, text=True).strip()


def build_source(folder: Path) -> tuple[Path, dict[str, bytes]]:
    """Builds the source distribution in a folder and this machine's wheel from it.

    Returns the path of the source distribution, and the wheel's files without binaries, by name.
    """
    with tempfile.TemporaryDirectory() as name:
        command = [sys.executable, "-m", "build", "--outdir", name, str(ROOT)]
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        if process.returncode != 0:
            last = f"{process.stdout[-4000:]}{process.stderr[-4000:]}"
            sys.exit(f"{' '.join(command)} failed:\n{last}")
        (source,), (wheel,) = Path(name).glob("*.tar.gz"), Path(name).glob("*.whl")
        return Path(shutil.copy(source, folder)), common_files(wheel)


def common_files(wheel: Path) -> dict[str, bytes]:
    """Returns the files of a wheel that every platform's wheel has, by name."""
    with zipfile.ZipFile(wheel) as archive:
        return {
            member: archive.read(member)
            for member in archive.namelist()
            if not member.startswith((BINARIES, LIBRARIES)) and not member.endswith("/RECORD")
        }


def bill_of_materials(base: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the list of foreign software in a wheel, in the form of CycloneDX (PEP 770).

    The viewer bundles packages of npm, and the binaries are compiled with fmpy's FMI headers.
    """
    (info,) = (name.rpartition("/")[0] for name in base if name.endswith(".dist-info/WHEEL"))
    package = json.loads((ROOT / "cosim" / "viewer" / "package.json").read_text(encoding="utf-8"))
    bundled = [("npm", *item) for item in package["dependencies"].items() if item[0] != "esbuild"]
    found = [
        {"type": "library", "name": name, "version": number, "purl": f"pkg:{kind}/{name}@{number}"}
        for kind, name, number in [*bundled, ("pypi", "fmpy", version("fmpy"))]
    ]
    content = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "components": found}
    return {f"{info}/sboms/bundled.cdx.json": (json.dumps(content, indent=1) + "\n").encode()}


def components() -> list[Component]:
    """Returns the components whose binaries a wheel holds."""
    added = [place for extension in extensions_in(ROOT) for place in extension.interfaces]
    return [PLANT, CONTROLLER, *(loaded(place)().component for place in added)]


def cross_compile() -> dict[tuple[str, str], bytes]:
    """Compiles the binaries of the FMUs and the loops for all targets, by library and target."""
    libraries = [*map(component_library, components()), *loop_libraries()]
    jobs = [(library, target) for target in TARGETS for library in libraries]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        built = pool.map(lambda job: build_library(*job), jobs)
        return {(job[0].name, job[1]): data for job, data in zip(jobs, built, strict=True)}


def loop_libraries() -> list[Library]:
    """Returns the libraries with the co-simulation loop, as their CMakeLists.txt build them."""
    return [_loop_library(name, folders) for name, folders in loop_folders().items()]


def _loop_library(name: str, loops: Sequence[Path]) -> Library:
    plant = ROOT / "plant_fmu"
    beside = ROOT.glob("extensions/*/*_fmu/include")  # of an extension's FMU, whose headers it uses
    files = {"src/message.c": plant / "src" / "message.c"}
    for include in (plant / "include", *beside, *(loop / "include" for loop in loops)):
        files |= {path.relative_to(include).as_posix(): path for path in include.rglob("*.h")}
    for loop in loops:
        files |= {f"src/{path.name}": path for path in (loop / "src").glob("*.[ch]")}
    flags = ("-DHX_SHARED", "-pthread")
    return Library(name, dict(sorted(files.items())), (fmi_headers(),), flags)


def write_wheel(
    base: Mapping[str, bytes],
    platform: Platform,
    binaries: Mapping[tuple[str, str], bytes],
    folder: Path,
) -> Path:
    """Writes the wheel of a platform: files sorted by name, all with SOURCE_DATE_EPOCH.

    base: the files that all wheels have, by name.
    binaries: by library and target; the loops of the platform's own target are packed, and the
        FMUs' binaries of all targets.
    """
    loops = loop_folders()
    (description,) = (name for name in base if name.endswith(".dist-info/WHEEL"))
    members = dict(base)
    members[description] = wheel_description(base[description], platform.tag)
    for (library, target), data in binaries.items():
        suffix = TARGETS[target].suffix
        if library not in loops:
            members[f"{BINARIES}{target}/{library}{suffix}"] = data
        elif target == platform.target:
            members[f"{LIBRARIES}{library}{suffix}"] = data
    name = description.removesuffix(".dist-info/WHEEL")
    path = folder / f"{name}-py3-none-{platform.tag}.whl"
    folder.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    with WheelFile(path, "w") as wheel:
        for member in sorted(members, key=lambda name: (".dist-info/" in name, name)):
            wheel.writestr(_entry(member), members[member])
    return path


def _entry(name: str) -> zipfile.ZipInfo:
    """Returns an entry as WheelFile makes it, with the best compression."""
    entry = zipfile.ZipInfo(name, get_zipinfo_datetime())
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry._compresslevel = BEST  # ZipFile.writestr takes it as an argument; WheelFile's does not
    entry.external_attr = (0o664 | stat.S_IFREG) << 16
    return entry


def wheel_description(text: bytes, platform_tag: str) -> bytes:
    """Returns a wheel's file WHEEL with the tags of a platform instead of this machine's."""
    lines = [line for line in text.decode().splitlines() if line and not line.startswith("Tag:")]
    lines += [f"Tag: py3-none-{tag}" for tag in platform_tag.split(".")]
    return ("\n".join(lines) + "\n").encode()


def write_hashes(folder: Path, files: Iterable[Path]) -> Path:
    """Writes SHA256SUMS, which `sha256sum --check` reads, and returns its path."""
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder).as_posix()}\n"
        for path in sorted(files)
    ]
    path = folder / "SHA256SUMS"
    path.write_text("".join(lines), encoding="utf-8")
    return path


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "dist"))
