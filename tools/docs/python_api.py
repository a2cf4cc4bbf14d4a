"""Writes the reference of the Python API.

Each module has a page, which Sphinx fills from its docstrings; each package has a list of modules.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {
    "models": "The robots as data, and every equation in plain numpy.",
    "controller": "How the robot walks: joint commands from a body velocity and from foot forces.",
    "cosim": "FMUs, scenarios, runs, results and reports.",
}
HIDDEN = ("cli", "__main__")  # the reference of commands covers them


def pages() -> Iterator[tuple[str, str]]:
    """Yields names and texts of the pages."""
    names = {package: list(_modules(ROOT / package)) for package in PACKAGES}
    for package, modules in names.items():
        for path in modules:
            dotted = _dotted(path)
            yield f"reference/python/{dotted}.md", _module_page(dotted)
        yield f"reference/python/{package}.md", _package_page(package, modules)
    yield "reference/python/index.md", _index()


def _modules(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        if not any(part in HIDDEN or part.startswith("_") for part in parts):
            yield path


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def _module_page(dotted: str) -> str:
    return (
        f"---\norphan: true\n---\n\n# {dotted}\n\n```{{eval-rst}}\n"
        f".. automodule:: hexapod_cosim.{dotted}\n   :members:\n```\n"
    )


def _package_page(package: str, modules: list[Path]) -> str:
    rows = "\n".join(
        f"| [{_dotted(path).partition('.')[2]}]({_dotted(path)}.md) | {_first_line(path)} |"
        for path in modules
    )
    intro = f"# {package}\n\n{PACKAGES[package]} Imported as `hexapod_cosim.{package}`.\n\n"
    return f"{intro}| module | what |\n|---|---|\n{rows}\n"


def _index() -> str:
    rows = "\n".join(
        f"| [{package}]({package}.md) | {text} |" for package, text in PACKAGES.items()
    )
    text = "All public modules, from their docstrings. "
    text += "Start with the [tutorial](../../tutorial.md) and the "
    text += "[notebooks](../../notebooks/index.md)."
    table = f"| package | what |\n|---|---|\n{rows}"
    contents = "```{toctree}\n:hidden:\nmodels\ncontroller\ncosim\n```"
    return f"# Python\n\n{text}\n\n{table}\n\n{contents}\n"


def _first_line(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return (
        text.split("\n\n")[0]
        .replace("\n", " ")
        .replace("|", "\\|")
        .replace("*", "\\*")
        .replace("[", "\\[")
    )
