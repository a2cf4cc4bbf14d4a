"""Builds the site: python -m tools.docs [-o build/docs] [--quick]."""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

from sphinx.cmd.build import main as sphinx

from hexapod_cosim.extensions.live.static_page import write_static_page
from tools.docs import c_api, commands, notebooks, python_api, validation, variables
from tools.docs.stage import DOCS, ROOT, Stage, pages

WALK = "walk.html"  # the robot on the front page (docs/index.md)


def build(out: Path, *, work: Path, computed: bool = True) -> int:
    """Builds the site and returns Sphinx's exit code, which is 0 without warnings.

    Args:
        out: folder of the site.
        work: folder in which the pages are assembled.
        computed: computes the validation and runs the notebooks.
    """
    shutil.rmtree(work, ignore_errors=True)
    stage = Stage(work)
    for page in pages():
        stage.add_page(page)
    for name, text in generated():
        stage.write(name, text)
    if computed:
        with notebooks.running(work / "notebooks"):
            validation.fill(work)
    out.mkdir(parents=True, exist_ok=True)
    write_static_page(out / WALK)
    options = ["-W", "--keep-going", "-q", "-n", "-E", "-j", "auto"]
    return int(
        sphinx([*options, "-c", str(DOCS), "-d", str(work / ".doctrees"), str(work), str(out)])
    )


def generated() -> list[tuple[str, str]]:
    """Returns names and texts of the pages of the reference."""
    fmus = [
        (f"reference/{name}.md", variables.page(interface))
        for name, interface in variables.interfaces().items()
    ]
    return [
        *fmus,
        ("reference/commands.md", commands.page()),
        ("reference/c.md", c_api.page()),
        *python_api.pages(),
    ]


def main() -> int:
    """Runs the command; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "build" / "docs", help="folder of the site"
    )
    parser.add_argument(
        "--quick", action="store_true", help="neither runs notebooks nor computes the validation"
    )
    parser.add_argument(
        "--work",
        type=Path,
        default=ROOT / "build" / "docs-pages",
        help="folder in which the pages are assembled",
    )
    arguments = parser.parse_args()
    began = time.monotonic()
    code = build(arguments.output, work=arguments.work, computed=not arguments.quick)
    if code == 0:
        count = len(list(arguments.output.rglob("*.html")))
        print(
            f"{arguments.output / 'index.html'}: {count} pages in {time.monotonic() - began:.0f} s"
        )
    return code


if __name__ == "__main__":
    raise SystemExit(main())
