"""Builds the site: python -m tools.docs [-o build/docs] [--quick]."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from sphinx.cmd.build import main as sphinx

import hexapod_cosim
from hexapod_cosim.cosim.cli.extension import extensions_in, loaded
from tools.docs import variables
from tools.docs.stage import DOCS, ROOT, add_page, pages, write

PYTHON = """# Python

All public modules, from their docstrings, a page for each folder. Start with the
[tutorial](../tutorial.md) and the [notebooks](../notebooks/index.md).

```{toctree}
:glob:
python/*
```
"""
AUTOMODULE = "```{{eval-rst}}\n.. automodule:: {}\n   {}\n```"
HEADERS = (
    "plant_fmu/include/hexapod/generated/plant_settings.h",
    "plant_fmu/include/hexapod/hexapod.h",
    "controller/fmu/include/hexapod/generated/controller_settings.h",
    "controller/fmu/include/hexapod/controller.h",
    "plant_fmu/include/hexapod/status.h",
    "plant_fmu/include/hexapod/legs.h",
)


def build(out: Path, *, work: Path, computed: bool = True) -> int:
    """Builds the site and returns Sphinx's exit code, which is 0 without warnings.

    Args:
        out: folder of the site.
        work: folder in which the pages are assembled.
        computed: computes the validation and runs the notebooks.
    """
    shutil.rmtree(work, ignore_errors=True)
    for page in pages():
        add_page(page, work)
    for name, text in generated(work):
        write(work / name, text)
    if computed:
        from tools.docs import validation  # noqa: PLC0415  needs the packages of the tests

        run_notebooks(work / "notebooks")
        validation.fill(work)
    out.mkdir(parents=True, exist_ok=True)
    for extension in extensions_in(ROOT):
        for name, place in extension.site.items():
            loaded(place)(out / name)
    write_walk_without_a_leg(out)
    options = ["-W", "--keep-going", "-q", "-n", "-E", "-j", "auto", "-c", str(DOCS)]
    return int(sphinx([*options, "-d", str(work / ".doctrees"), str(work), str(out)]))


def write_walk_without_a_leg(out: Path) -> None:
    """Writes lost_leg.html, the report of a walk that loses a leg, and its figures in plots/."""
    with TemporaryDirectory() as folder:
        walk = hexapod_cosim.simulate("lost_leg")
        page = hexapod_cosim.report(walk, Path(folder) / "lost_leg")
        shutil.copyfile(page, out / "lost_leg.html")
        shutil.copytree(page.parent / "plots", out / "plots", dirs_exist_ok=True)


def run_notebooks(folder: Path) -> None:
    """Runs the notebooks of a folder and writes their outputs into them.

    Sphinx reads pages in forked processes, in which no kernel starts.
    """
    for path in sorted(folder.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        place = {"metadata": {"path": str(folder)}}
        NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place).execute()
        nbformat.write(notebook, path)


def generated(work: Path) -> Iterator[tuple[str, str]]:
    """Yields names and texts of the pages of the reference; Sphinx makes those of Python."""
    for name, interface in variables.interfaces().items():
        yield f"reference/{name}.md", variables.page(interface)
    yield "reference/commands.md", commands()
    yield "reference/python.md", PYTHON
    for part in ("models", "controller", "cosim"):
        yield from folder_pages(f"hexapod_cosim.{part}")
    yield "reference/c.md", c_headers(work / "reference")


def folder_pages(folder: str) -> Iterator[tuple[str, str]]:
    """Yields the page of a package with all its modules, and those of the packages within it."""
    package = import_module(folder)
    found = list(iter_modules(package.__path__, f"{folder}."))
    modules = [one.name for one in found if not one.ispkg and one.name.rpartition(".")[2][0] != "_"]
    lines = [f"# {folder}", AUTOMODULE.format(folder, "" if modules else ":members:")]
    lines += [f"## {name}\n\n{AUTOMODULE.format(name, ':members:')}" for name in modules]
    yield f"reference/python/{folder}.md", "\n\n".join(lines) + "\n"
    for one in found:
        if one.ispkg and one.name != "hexapod_cosim.cosim.cli":
            yield from folder_pages(one.name)


def commands() -> str:
    """Returns the page on all commands, from their --help, by typer's own tool."""
    words = ["hexapod_cosim.cosim.cli.app", "utils", "docs", "--name", "hexapod"]
    command = [sys.executable, "-m", "typer", *words, "--title", "Commands"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def c_headers(folder: Path) -> str:
    """Returns a page in a folder that shows the public headers."""
    parts = ["# C\n\nThe plant and the controller without FMI: a shared library each, in C11.\n"]
    for header in HEADERS:
        place = os.path.relpath(ROOT / header, folder)
        parts.append(
            f"## {Path(header).name}\n\n```{{literalinclude}} {place}\n:language: c\n```\n"
        )
    return "\n".join(parts)


def main() -> int:
    """Runs the command; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "docs")
    parser.add_argument(
        "--quick", action="store_true", help="neither runs notebooks nor computes the validation"
    )
    parser.add_argument(
        "--work",
        type=Path,
        default=ROOT / "build" / "docs-pages",
        help="folder in which the pages are assembled",
    )
    given = parser.parse_args()
    code = build(given.output, work=given.work, computed=not given.quick)
    if code == 0:
        print(given.output / "index.html")
    return code


if __name__ == "__main__":
    raise SystemExit(main())
