"""Cross-compiles shared libraries with the C compiler of the ziglang package.

Zig contains each system's headers and link stubs, so nothing else has to be installed. Sources are
compiled in a temporary folder under their relative names, so that binaries contain no path of this
machine and depend on sources, compiler and flags only. These are the key of the cache.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata, util
from pathlib import Path

import platformdirs

from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.models.errors import FmuError, HexapodError

PACKAGE = "ziglang"
APPLICATION = "hexapod-cosim"
SHOWN_LINES = 12  # of the compiler's messages

# as in plant_fmu/CMakeLists.txt, which gives the reasons
COMPILE = (
    "-std=c11",
    "-O3",
    "-g0",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fvisibility=hidden",
    "-fno-ident",
)
ELF = ("-fPIC", "-Wl,-z,relro,-z,now,--no-undefined", "-lm")


@dataclass(frozen=True)
class Target:
    """A system and processor: Zig's name, suffix and flags of its shared libraries."""

    triple: str
    suffix: str
    link: tuple[str, ...] = ()
    processor: str = "baseline"
    shared: tuple[str, ...] = ("-shared", "-s")


# the oldest supported systems: CentOS 7 (glibc 2.17), macOS 11 (the first for both processors),
# Windows 10
TARGETS = {
    "x86_64-linux": Target("x86_64-linux-gnu.2.17", ".so", ELF),
    "aarch64-linux": Target("aarch64-linux-gnu.2.17", ".so", ELF),
    "x86_64-windows": Target("x86_64-windows-gnu", ".dll"),
    "x86_64-darwin": Target("x86_64-macos.11.0", ".dylib"),
    "aarch64-darwin": Target("aarch64-macos.11.0", ".dylib"),
}


@dataclass(frozen=True)
class Library:
    """The sources and flags of a shared library.

    sources: C files and headers by their path in the include folder.
    headers: further include folders.
    """

    name: str
    sources: Mapping[str, Path]
    headers: tuple[Path, ...] = ()
    flags: tuple[str, ...] = field(default=())

    def digest(self) -> str:
        """Returns a hash of names, flags and contents of all files."""
        parts = [self.name, *self.flags]
        files = [
            *self.sources.items(),
            *(
                (f"{n}/{path.name}", path)
                for n, folder in enumerate(self.headers)
                for path in _headers(folder)
            ),
        ]
        parts += [f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for name, path in files]
        return _digest(parts)


@dataclass(frozen=True)
class Compiler:
    """A compiler driver and its version."""

    command: tuple[str, ...]
    version: str


@cache
def find_compiler() -> Compiler:
    """Returns the installed cross compiler. Raises FmuError when there is none."""
    spec = util.find_spec(PACKAGE)
    if spec is None or spec.origin is None:
        fix = (
            f"{install_extra('platforms')}; without --platforms an FMU gets this machine's "
            "installed binary"
        )
        raise FmuError("no cross compiler", got=f"no package {PACKAGE}", expected=PACKAGE, fix=fix)
    program = Path(spec.origin).parent / ("zig.exe" if os.name == "nt" else "zig")
    return Compiler((str(program), "cc"), metadata.version(PACKAGE))


def build_library(
    library: Library,
    target: str | Target,
    *,
    compiler: Compiler | None = None,
    cache_folder: Path | None = None,
) -> bytes:
    """Builds a shared library for a target, or takes it from the cache.

    Args:
        library: the library to build.
        target: a key of TARGETS, or another target of the compiler.
        compiler: the installed one by default.
        cache_folder: the user's by default; processes may share it.

    Raises FmuError without a compiler, and for sources that do not compile.
    """
    compiler, folder = compiler or find_compiler(), cache_folder or user_cache()
    chosen = TARGETS[target] if isinstance(target, str) else target
    flags = (*_flags(library, chosen), *library.flags)
    key = _digest([library.digest(), compiler.version, *flags])
    kept = folder / "binaries" / f"{library.name}-{chosen.triple}-{key[:32]}{chosen.suffix}"
    if kept.is_file():
        return kept.read_bytes()
    data = _compile(library, [*compiler.command, *flags], chosen, folder)
    _keep(kept, data)
    return data


def user_cache() -> Path:
    """Returns the user's cache folder, where binaries are kept."""
    return Path(platformdirs.user_cache_path(APPLICATION, appauthor=False))


def _flags(library: Library, target: Target) -> tuple[str, ...]:
    """Returns the flags of compiler and linker for a target."""
    link = (
        (f"-Wl,-install_name,@rpath/{library.name}{target.suffix}",)
        if target.suffix == ".dylib"
        else target.link
    )
    processor = f"-mcpu={target.processor}"
    return ("-target", target.triple, processor, *COMPILE, *target.shared, *link)


def _compile(library: Library, command: Sequence[str], target: Target, cache_folder: Path) -> bytes:
    """Copies the sources into a folder, compiles them there and returns the library's bytes."""
    with TemporaryFolder("build") as name:
        root, out = name, library.name + target.suffix
        for path, source in library.sources.items():
            (root / "in" / path).parent.mkdir(parents=True, exist_ok=True)
            (root / "in" / path).write_bytes(source.read_bytes())
        for number, folder in enumerate(library.headers):
            (root / "in" / f"headers{number}").mkdir(parents=True)
            for header in _headers(folder):
                (root / "in" / f"headers{number}" / header.name).write_bytes(header.read_bytes())
        (root / "out").mkdir()
        includes = [
            "-I.",
            *(
                item
                for number in range(len(library.headers))
                for item in ("-isystem", f"headers{number}")
            ),
        ]
        sources = [path for path in library.sources if path.endswith(".c")]
        _run([*command, *includes, *sources, "-o", f"../out/{out}"], root, target, cache_folder)
        return (root / "out" / out).read_bytes()


def _run(command: Sequence[str], root: Path, target: Target, cache_folder: Path) -> None:
    """Runs the compiler. Raises FmuError when it fails."""
    process = subprocess.run(
        command,
        cwd=root / "in",
        env=compiler_environment(root, cache_folder),
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if process.returncode != 0:
        messages = (
            "\n".join(process.stderr.splitlines()[:SHOWN_LINES])
            or f"exit code {process.returncode}"
        )
        fix = "correct the sources, or reinstall the compiler if it is damaged"
        raise FmuError(
            f"cannot build for {target.triple}",
            got=messages,
            expected="sources that compile",
            fix=fix,
        )


def compiler_environment(scratch: Path, cache_folder: Path) -> dict[str, str]:
    """Returns the compiler's environment variables.

    Compiled system libraries are kept in the cache; other temporary files go to the scratch folder.
    """
    folders = {
        "ZIG_LOCAL_CACHE_DIR": scratch / "zig",
        "ZIG_GLOBAL_CACHE_DIR": _writable(cache_folder / "zig", scratch),
    }
    return os.environ | {name: str(folder) for name, folder in folders.items()}


def _writable(folder: Path, otherwise: Path) -> Path:
    """Returns the folder if it can be written, else a folder in `otherwise`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return otherwise / "zig-global"
    return folder if os.access(folder, os.W_OK) else otherwise / "zig-global"


def _keep(path: Path, data: bytes) -> None:
    """Writes to the cache atomically; does nothing when the cache cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as part:
            part.write_bytes(data)
    except (OSError, HexapodError):
        return


def _headers(folder: Path) -> list[Path]:
    """Returns the headers in a folder, sorted."""
    return sorted(folder.glob("*.h"))


def _digest(parts: Sequence[str]) -> str:
    """Returns a hash of texts."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
