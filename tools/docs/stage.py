"""Copies the pages of the site from docs/ and the root into one folder.

Links on the pages are relative paths in the repository. In the copy a link to another page leads to
its copy, a link to a file to that file, which Sphinx offers as a download, and a link to a folder
becomes its text, as does one to an extension that was deleted.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS, EXTENSIONS = ROOT / "docs", ROOT / "extensions"
# pages outside docs/, and files for which the site has a better page
ELSEWHERE = {".github/CONTRIBUTING.md": "contributing.md", "benchmarks/README.md": "benchmarks.md"}
INSTEAD = {
    "README.md": "index.md",
    "plant_fmu/interface.toml": "reference/plant.md",
    "controller/fmu/interface.toml": "reference/controller.md",
    "plant_fmu/include/hexapod/hexapod.h": "reference/c.md",
    "controller/fmu/include/hexapod/controller.h": "reference/c.md",
}
# a link or a picture, or inline code outside of links, which is left as it is
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)|`[^`\n]+`")
FENCE = re.compile(r"(^```.*?^```[^\n]*$)", flags=re.DOTALL | re.MULTILINE)


class BrokenLinkError(Exception):
    """A link whose target does not exist."""


def pages() -> Iterator[Path]:
    """Yields the pages of the repository that are also pages of the site."""
    yield from sorted([*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")])
    yield from (ROOT / name for name in ELSEWHERE if not name.startswith("docs/"))
    yield from sorted(EXTENSIONS.glob("*/README.md"))


def page_name(path: Path) -> str | None:
    """Returns the name on the site of a page, None for other files."""
    inside = path.relative_to(ROOT).as_posix()
    if inside in ELSEWHERE | INSTEAD:
        return (ELSEWHERE | INSTEAD)[inside]
    if path.name == "README.md" and path.parent.parent == EXTENSIONS:
        return f"extensions/{path.parent.name}.md"
    if path.suffix not in {".md", ".ipynb"} or not path.is_relative_to(DOCS):
        return None
    name = path.relative_to(DOCS)
    return (name.with_name("index.md") if name.name == "README.md" else name).as_posix()


def write(path: Path, text: str) -> None:
    """Writes a file and makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def add_page(source: Path, folder: Path) -> None:
    """Copies a page into the folder and converts its links."""
    name = page_name(source)
    assert name is not None
    text, place = source.read_text(encoding="utf-8"), folder / name
    if source.suffix == ".ipynb":
        notebook = json.loads(text)
        for cell in notebook["cells"]:
            if cell["cell_type"] == "markdown":
                cell["source"] = linked("".join(cell["source"]), source, place, folder)
        text = json.dumps(notebook)
    else:
        text = linked(text, source, place, folder)
    write(place, text)


def linked(text: str, source: Path, place: Path, folder: Path) -> str:
    """Converts the links of a page's text, except in code."""

    def change(match: re.Match[str]) -> str:
        if match[3] is None:
            return match[0]
        target = converted(match[3], source, place, folder)
        return match[2] if target is None else f"{match[1]}[{match[2]}]({target})"

    return outside_code(text, lambda part: LINK.sub(change, part))


def converted(link: str, source: Path, place: Path, folder: Path) -> str | None:
    """Returns the target of a link on the copy at `place`; None for a folder and for
    an extension that was deleted.

    Raises BrokenLinkError.
    """
    path, _, anchor = link.partition("#")
    if "://" in link or link.startswith("mailto:") or not path:
        return link
    found = (source.parent / path).resolve()
    if is_deleted_extension(found):
        return None
    if not found.exists() or not found.is_relative_to(ROOT):
        raise BrokenLinkError(
            f"{source.relative_to(ROOT)}: link to {link}: no such file;"
            " expected a path relative to the page"
        )
    if found.is_dir():
        return None
    name = page_name(found)
    target = os.path.relpath(folder / name if name else found, place.parent)
    return target + (f"#{anchor}" if anchor and found.suffix == ".md" else "")


def is_deleted_extension(path: Path) -> bool:
    """Returns whether a path is one of an extension whose folder does not exist."""
    if not path.is_relative_to(EXTENSIONS):
        return False
    parts = path.relative_to(EXTENSIONS).parts
    return len(parts) > 1 and not (EXTENSIONS / parts[0]).is_dir()


def outside_code(text: str, change: Callable[[str], str]) -> str:
    """Applies `change` to a page, except to its code blocks."""
    return "".join(part if part.startswith("```") else change(part) for part in FENCE.split(text))
