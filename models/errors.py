"""Defines the exceptions of this package and their messages: where, what, got, expected, fix."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from os import PathLike, fspath
from typing import Any

LONGEST = 600  # characters of a value that a message quotes
NAME_SIZE, PATH_SIZE = 255, 4000  # bytes, characters  of names and paths


class HexapodError(Exception):
    """Base class of all exceptions that this package raises on purpose.

    The data remain available as attributes.

    Args:
        what: the error, as a clause ("mass is not positive").
        got: the invalid value; None omits it.
        expected: the valid values, in words.
        fix: what the user can do, as an imperative.
        where: the location, for example file and key.
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
        facts = [f"got {shortened(repr(self.got))}"] if self.got is not None else []
        facts += [f"expected {self.expected}"] if self.expected is not None else []
        text = f"{shortened(self.where)}: {self.what}" if self.where else self.what
        text += f": {', '.join(facts)}" if facts else ""
        return f"{text}; {self.fix}" if self.fix else text

    def __reduce__(self) -> tuple[Any, ...]:
        """Keeps the keyword arguments when the exception is pickled."""
        return _rebuild, (type(self), self.what, self.got, self.expected, self.fix, self.where)


def _rebuild(
    kind: type[HexapodError], what: str, got: Any, expected: Any, fix: str | None, where: str | None
) -> HexapodError:
    """Creates an unpickled exception."""
    return kind(what, got=got, expected=expected, fix=fix, where=where)


def shortened(text: str) -> str:
    """Returns a text for a message: one of more than LONGEST characters without its middle."""
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2 - 20
    return f"{text[:half]} ... ({len(text)} characters) ... {text[-half:]}"


def check_type(
    value: object,
    kinds: type | tuple[type, ...],
    expected: str,
    *,
    where: str,
    error: type[HexapodError] = HexapodError,
) -> None:
    """Raises an error for an argument of another type. where: the argument's name."""
    if isinstance(value, kinds):
        return
    raise error(
        "wrong type of an argument",
        got="nothing (None)" if value is None else value,
        expected=expected,
        where=where,
    )


def refuse_path(path: str | PathLike[str], what: str, error: type[HexapodError]) -> None:
    """Raises an error for a path that no system can open: with a NUL, or too long."""
    check_type(path, (str, PathLike), f"a path of {what}, or a name", where="path", error=error)
    text = fspath(path)
    longest = max(len(part.encode("utf-8", "surrogatepass")) for part in text.split("/"))
    if "\0" not in text and longest <= NAME_SIZE and len(text) <= PATH_SIZE:
        return
    raise error(
        f"no path of {what}",
        got=text,
        expected=f"a path without NUL, of at most {PATH_SIZE} characters, "
        f"with names of at most {NAME_SIZE} bytes",
        fix="give another path",
    )


class RobotError(HexapodError):
    """A robot or a robot file is invalid."""


class ReachError(HexapodError):
    """No pose of a leg reaches a point."""


class ScenarioError(HexapodError):
    """A scenario is invalid."""


class FmuError(HexapodError):
    """An FMU is missing, invalid or damaged, or a call of it failed."""


LEAST_SIMILARITY = 0.65  # of difflib, in [0, 1]; "trot" and "tripod" have 0.6
LEAST_OF_SHORT = 0.5  # of names of at most SHORT characters, such as "my" for "mu"
SHORT = 3
# up to this similarity, names with different first letters share letters by chance: "foo", "robot"
CHANCE = 0.52
LEAST_BEGINNING = 3  # characters of a name's beginning that say which name is meant


def nearest_name(name: str, valid: Iterable[str]) -> str | None:
    """Returns the valid name most similar to `name`, or None when none is similar.

    The first one that begins with `name` precedes all others.
    """
    names = list(valid)
    longer = [one for one in names if one.startswith(name)]
    if longer and len(name) >= LEAST_BEGINNING:
        return longer[0]
    least = LEAST_OF_SHORT if len(name) <= SHORT else LEAST_SIMILARITY
    for match in get_close_matches(name, names, cutoff=least):
        if match[:1] == name[:1] or SequenceMatcher(None, match, name).ratio() > CHANCE:
            return match
    return None


def suggestion(name: str, valid: Iterable[str], *, otherwise: str) -> str:
    """Returns the fix for an unknown name: the valid name nearest to it, or another fix."""
    near = nearest_name(name, valid)
    return f"did you mean {near!r}?" if near else otherwise


def unknown_name(
    kind: str,
    name: str,
    valid: Iterable[str],
    *,
    where: str | None = None,
    error: type[HexapodError] = HexapodError,
) -> HexapodError:
    """Returns the exception for a name outside a closed list.

    The message lists the valid names and proposes the most similar one.
    """
    names = list(valid)
    fix = suggestion(str(name), names, otherwise="write one of these names")
    return error(
        f"unknown {kind}", got=name, expected=f"one of {', '.join(names)}", fix=fix, where=where
    )
