"""What goes wrong, told in one paragraph: where, what, got, expected, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any


class HexapodError(Exception):
    """Base of every error this package raises on purpose. The data stay readable as attributes.

    Args:
        what: the fault, as a clause ("mass is not positive").
        got: the offending value; None when there is none to show.
        expected: what would have been accepted, in words.
        fix: what the reader can do, as an imperative.
        where: file and key, or the like.
    """

    def __init__(
        self,
        what: str,
        *,
        got: Any = None,
        expected: Any = None,
        fix: str | None = None,
        where: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.got = got
        self.expected = expected
        self.fix = fix
        self.where = where

    def __str__(self) -> str:
        facts = [f"got {self.got!r}"] if self.got is not None else []
        facts += [f"expected {self.expected}"] if self.expected is not None else []
        text = f"{self.where}: {self.what}" if self.where else self.what
        text += f": {', '.join(facts)}" if facts else ""
        return f"{text}; {self.fix}" if self.fix else text

    def __reduce__(self) -> tuple[Any, ...]:
        """Keeps the keyword arguments when an error crosses a process border."""
        return _rebuild, (type(self), self.what, self.got, self.expected, self.fix, self.where)


def _rebuild(
    kind: type[HexapodError], what: str, got: Any, expected: Any, fix: str | None, where: str | None
) -> HexapodError:
    return kind(what, got=got, expected=expected, fix=fix, where=where)


class RobotError(HexapodError):
    """A robot file, or a robot, that cannot be."""


class ReachError(HexapodError):
    """A point that no pose of a leg reaches."""


class ScenarioError(HexapodError):
    """A scenario that cannot be run."""


class FmuError(HexapodError):
    """An FMU that is missing, foreign, damaged, or that refused a call."""


def nearest_name(name: str, valid: Iterable[str]) -> str | None:
    """The valid name most like `name`, or None when nothing is near."""
    match = get_close_matches(name, list(valid), n=1, cutoff=0.5)
    return match[0] if match else None


def unknown_name(
    kind: str,
    name: str,
    valid: Iterable[str],
    *,
    where: str | None = None,
    error: type[HexapodError] = HexapodError,
) -> HexapodError:
    """The error for a name that is not on a closed list: lists the valid ones and proposes the
    nearest.
    """
    names = list(valid)
    near = nearest_name(name, names)
    fix = f"did you mean {near!r}?" if near else f"choose one of the {len(names)} valid names"
    return error(
        f"unknown {kind}", got=name, expected=f"one of {', '.join(names)}", fix=fix, where=where
    )
