"""Assembles the pages of the site: docs/, pages of the root, and the files that they link to.

Links on the pages are relative paths in the repository. On the site a link to another page leads to
that page, and a link to a file or folder to a page that shows it, so the site does not need the
repository.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
# pages outside docs/, and files for which the site has a better page
ELSEWHERE = {
    ".github/CONTRIBUTING.md": "contributing.md",
    "docs/CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
}
INSTEAD = {
    "README.md": "index.md",
    "docs/README.md": "index.md",
    "plant_fmu/interface.toml": "reference/plant.md",
    "controller/fmu/interface.toml": "reference/controller.md",
    "plant_fmu/include/hexapod/hexapod.h": "reference/c.md",
    "controller/fmu/include/hexapod/controller.h": "reference/c.md",
}
PACKAGES = ("models", "controller", "cosim")  # with a page per module in the reference
LANGUAGES = {
    ".py": "python",
    ".c": "c",
    ".h": "c",
    ".cpp": "cpp",
    ".toml": "toml",
    ".json": "json",
    ".xml": "xml",
    ".md": "markdown",
}
PICTURES = (".png", ".svg", ".jpg", ".webp")
LINK = re.compile(r"(?<=\]\()([^)\s]+)(?=\))")
CODE = re.compile(r"(^```.*?^```[^\n]*$|`[^`\n]+`)", flags=re.DOTALL | re.MULTILINE)
HIDDEN = ("__pycache__", "generated")


class BrokenLinkError(Exception):
    """A link whose target does not exist."""


@dataclass
class Stage:
    """A folder into which the pages for Sphinx are written."""

    folder: Path
    shown: set[str] = field(default_factory=set)  # files and folders that have a page

    def write(self, name: str, text: str) -> None:
        """Adds a page."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def add_page(self, source: Path) -> None:
        """Adds a page of the repository and converts its links to those of the site."""
        name, text = page_name(source), source.read_text(encoding="utf-8")
        if source.suffix == ".ipynb":
            notebook = json.loads(text)
            for cell in notebook["cells"]:
                if cell["cell_type"] == "markdown":
                    cell["source"] = self._linked("".join(cell["source"]), source, name)
            self.write(name, json.dumps(notebook))
        else:
            self.write(name, self._linked(text, source, name))

    def _linked(self, text: str, source: Path, name: str) -> str:
        return outside_code(
            text, lambda part: LINK.sub(lambda match: self._target(match[1], source, name), part)
        )

    def _target(self, link: str, source: Path, name: str) -> str:
        """Returns the target on the site of a link of a page."""
        path, _, anchor = link.partition("#")
        if "://" in link or link.startswith("mailto:") or not path:
            return link
        found = (source.parent / path).resolve()
        if not found.exists() or not found.is_relative_to(ROOT):
            raise BrokenLinkError(
                f"{source.relative_to(ROOT)}: link to {link}: no such file;"
                " expected a path relative to the page"
            )
        relative = os.path.relpath(self._place(found), PurePosixPath(name).parent)
        return relative + (f"#{anchor}" if anchor and found.suffix == ".md" else "")

    def _place(self, found: Path) -> str:
        """Returns the name on the site of a file or folder, which is added if it is missing."""
        inside = found.relative_to(ROOT).as_posix()
        if inside in INSTEAD:
            return INSTEAD[inside]
        if is_page(found):
            return page_name(found)
        if found.suffix in PICTURES:
            return self._copy(found)
        return self.show(found)

    def _copy(self, found: Path) -> str:
        name = found.relative_to(DOCS if found.is_relative_to(DOCS) else ROOT).as_posix()
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(found, self.folder / name)
        return name

    def show(self, found: Path) -> str:
        """Returns the page that shows a file or lists a folder; writes it if it is missing."""
        inside = found.relative_to(ROOT).as_posix()
        name = f"source/{inside}/index.md" if found.is_dir() else f"source/{inside}.md"
        if inside not in self.shown:
            self.shown.add(inside)
            self.write(name, self._listing(found, name) if found.is_dir() else listing_of(found))
        return name

    def _listing(self, folder: Path, name: str) -> str:
        entries = [
            entry
            for entry in sorted(folder.iterdir())
            if not entry.name.startswith(".") and entry.name not in HIDDEN
        ]
        rows = "\n".join(
            f"- {_named(entry, name)}" for entry in entries if entry.is_dir() or is_text(entry)
        )
        return f"---\norphan: true\n---\n\n# {folder.relative_to(ROOT).as_posix()}/\n\n{rows}\n"


def _named(entry: Path, page: str) -> str:
    """Formats a file or folder in a list; a module of a package links to its reference."""
    package = entry.parent.relative_to(ROOT).as_posix()
    if package not in PACKAGES or entry.suffix != ".py" or entry.stem.startswith("_"):
        return f"`{entry.name}{'/' if entry.is_dir() else ''}`"
    reference = f"reference/python/{package}.{entry.stem}.md"
    return f"[`{entry.name}`]({os.path.relpath(reference, PurePosixPath(page).parent)})"


def pages() -> Iterator[Path]:
    """Yields the pages of the repository that are also pages of the site."""
    yield from sorted(
        path for path in DOCS.rglob("*.md") if path.name != "README.md" or path.parent != DOCS
    )
    yield from sorted(DOCS.rglob("*.ipynb"))
    yield from (ROOT / name for name in ELSEWHERE)


def is_page(path: Path) -> bool:
    """Returns whether a file is such a page."""
    return path.relative_to(ROOT).as_posix() in ELSEWHERE or (
        path.suffix in {".md", ".ipynb"} and path.is_relative_to(DOCS)
    )


def page_name(path: Path) -> str:
    """Returns the name of a page on the site."""
    inside = path.relative_to(ROOT).as_posix()
    if inside in ELSEWHERE:
        return ELSEWHERE[inside]
    name = path.relative_to(DOCS)
    return (name.with_name("index.md") if name.name == "README.md" else name).as_posix()


def outside_code(text: str, change: Callable[[str], str]) -> str:
    """Applies `change` to a page, except to its code blocks and inline code."""
    return "".join(part if part.startswith("`") else change(part) for part in CODE.split(text))


def is_text(path: Path) -> bool:
    """Returns whether a file is a text file."""
    return (
        path.suffix in {*LANGUAGES, ".txt", ".csv", ".jinja", ".cff", ""}
        and b"\0" not in path.read_bytes()[:1024]
    )


def listing_of(path: Path) -> str:
    """Returns a page that shows a file."""
    inside, text = path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    fence, language = "`" * 8, LANGUAGES.get(path.suffix, "text")
    head = f"---\norphan: true\n---\n\n# {path.name}\n\n`{inside}`"
    return f"{head}\n\n{fence}{language}\n{text.rstrip()}\n{fence}\n"
