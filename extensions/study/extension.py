"""What this extension adds to the command line; imports nothing slow."""

from __future__ import annotations

from pathlib import Path

from hexapod_cosim.cosim.cli.extension import Command, Extension, Rows

MODULE = "hexapod_cosim.extensions.study.command"
STUDY = Command(
    name="study",
    about="Run a study: a sweep, a Monte Carlo study or an optimisation.",
    place=f"{MODULE}:study",
)
EXTENSION = Extension(
    commands=[STUDY],
    reports={"study": f"{MODULE}:report_again"},
    lists={"studies": "hexapod_cosim.extensions.study.extension:bundled_studies"},
)


def list_studies() -> dict[str, Path]:
    """Returns the studies that come with the package, by name."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "studies").glob("*.toml"))}


def bundled_studies() -> Rows:
    """Returns what `hexapod list studies` shows."""
    from hexapod_cosim.cosim.cli.catalogue import titles  # noqa: PLC0415

    return titles(list_studies())
