"""Loads the class of a user's Python file and drives its object as a controller.

Any exception of the user's code becomes one sentence with the file, the line and the function.
"""

from __future__ import annotations

import importlib.util
import inspect
import linecache
import sys
import traceback
from collections.abc import Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from hexapod_cosim.controller import BodyCommand, ControllerError, JointCommand, Measurement
from hexapod_cosim.cosim.common.files import file_stamp
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, suggestion
from hexapod_cosim.models.errors import nearest_name

if TYPE_CHECKING:
    from collections.abc import Iterator

SHAPE = (len(LEG_NAMES), len(JOINT_NAMES))
REFERENCES = ("angle_ref", "speed_ref", "torque_ref", "acceleration_ref")
BY_NAME = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def load_class(path: Path, name: str) -> type[Any]:
    """Returns a class of a Python file. Raises ControllerError."""
    if not path.is_file():
        raise ControllerError(
            "no such file",
            got=str(path),
            expected=f"a Python file with the class {name}",
            fix="`hexapod controller new NAME` writes one",
        )
    module = _module(path, *file_stamp(path))
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [
            key
            for key, value in vars(module).items()
            if isinstance(value, type) and value.__module__ == module.__name__
        ]
        otherwise = f"write path:{classes[0]}" if classes else "write the class"
        raise ControllerError(
            "no such class",
            got=name,
            expected=f"one of {', '.join(classes)}" if classes else "a class with the method step",
            fix=suggestion(name, classes, otherwise=otherwise),
            where=str(path),
        )
    return found


@lru_cache(maxsize=32)
def _module(path: Path, _changed: int, _size: int) -> ModuleType:
    """Imports a Python file, anew after it was changed. Modules beside the file can be imported."""
    name = f"hexapod_law_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        expected, fix = "a name that ends in .py", "rename the file"
        raise ControllerError("not a Python file", got=str(path), expected=expected, fix=fix)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    sys.path.insert(0, str(path.parent))
    linecache.checkcache(str(path))
    try:
        with users_errors(path):
            spec.loader.exec_module(module)
    except ControllerError:
        sys.modules.pop(name, None)
        raise
    finally:
        with suppress(ValueError):
            sys.path.remove(str(path.parent))
    return module


def parameters_of(law: type[Any]) -> tuple[dict[str, bool], bool]:
    """Returns whether each parameter of a class is required, and whether it takes any name."""
    if law.__init__ is object.__init__:
        return {}, False
    try:
        found = inspect.signature(law).parameters.values()
    except ValueError:  # a class of C code, such as dict
        return {}, False
    named = {item.name: item.default is item.empty for item in found if item.kind in BY_NAME}
    return named, any(item.kind is item.VAR_KEYWORD for item in found)


def build(law: type[Any], path: Path, given: Mapping[str, Any], settings: Mapping[str, Any]) -> Any:
    """Returns an object of the user's class, which gets the arguments that it asks for by name.

    Args:
        law: the class.
        path: its file, for messages.
        given: arguments that every class may ask for: robot, period, gait.
        settings: the parameters of the scenario's [control].

    Raises:
        ControllerError: a required argument is not there, or the class raises an exception.
    """
    with users_errors(path):
        named, takes_all = parameters_of(law)
    values = {**settings, **given}
    missing = [name for name, required in named.items() if required and name not in values]
    if missing:
        near = nearest_name(missing[0], settings)
        raise ControllerError(
            f"{law.__name__} asks for a parameter that is not given",
            got=missing[0],
            expected=f"{', '.join(given)} or a key of the scenario's [control]",
            fix=f"did you mean {missing[0]!r} by {near!r} in [control]?"
            if near
            else f"write --set control.{missing[0]}=VALUE, or give it a default",
            where=str(path),
        )
    chosen = {name: values[name] for name in named if name in values}
    if takes_all:
        chosen |= {name: value for name, value in settings.items() if name not in chosen}
    with users_errors(path):
        made = law(**chosen)
    if not callable(getattr(made, "step", None)):
        raise ControllerError(
            f"{law.__name__} has no method step",
            expected="step(t, command, measurement), which returns joint commands",
            fix="`hexapod controller new NAME` writes an example",
            where=str(path),
        )
    return made


class PythonLaw:
    """Drives a user's controller object: checks its commands and explains its exceptions.

    `path`: the file of its class, if known. Raises ControllerError when its method step takes other
    arguments.
    """

    def __init__(self, law: Any, *, path: Path | None = None) -> None:
        self._law, self._path = law, path or file_of(type(law))
        self._name = type(law).__name__
        _check_signature(law, self._path)
        self.diagnostics = getattr(law, "diagnostics", None)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The controller's warnings, if it has such a list of texts."""
        found = getattr(self._law, "warnings", ())
        return tuple(map(str, found)) if isinstance(found, list | tuple) else ()

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the checked joint commands of the user's controller. Raises ControllerError."""
        with users_errors(self._path):
            result = self._law.step(t, command, measurement)
            if not isinstance(result, JointCommand):  # joint angles alone
                angle = np.asarray(result, dtype=np.float64)
                result = JointCommand(angle_ref=angle) if angle.shape == SHAPE else result
        if not isinstance(result, JointCommand):
            raise self._error(
                "step returns no joint command",
                got=f"an array {result.shape}"
                if isinstance(result, np.ndarray)
                else type(result).__name__,
                expected="a JointCommand, or joint angles (6, 3) in rad",
            )
        for name in REFERENCES:
            self._check(name, getattr(result, name), t)
        return result

    def _check(self, name: str, value: Any, t: float) -> None:
        """Raises ControllerError for a reference of a wrong shape or without finite numbers."""
        if np.shape(value) != SHAPE:
            raise self._error(f"{name} has a wrong shape", got=np.shape(value), expected=SHAPE)
        if not np.isfinite(value).all():
            leg, joint = np.argwhere(~np.isfinite(value))[0]
            place = f"{LEG_NAMES[leg]}.{JOINT_NAMES[joint]}.{name}"
            raise self._error(
                f"{place} is not finite at {t:g} s", got=float(value[leg][joint]),
                expected="finite numbers",
            )  # fmt: skip

    def _error(self, what: str, *, got: Any, expected: Any) -> ControllerError:
        where = self._name if self._path is None else f"{self._path}: {self._name}"
        return ControllerError(
            what, got=got, expected=expected, fix="correct its method step", where=where
        )


def _check_signature(law: Any, path: Path | None) -> None:
    """Raises ControllerError for a method step that cannot be called with three arguments."""
    try:
        found = inspect.signature(law.step)
    except (TypeError, ValueError):  # of C code, which has no signature
        return
    try:
        found.bind("t", "command", "measurement")
    except TypeError:
        raise ControllerError(
            f"{type(law).__name__}.step takes other arguments",
            got=f"step{found}",
            expected="step(t, command, measurement)",
            fix="write `def step(self, t, command, measurement):`",
            where=None if path is None else str(path),
        ) from None


def file_of(law: type[Any]) -> Path | None:
    """Returns the file of a class; None for a class of a notebook or of C code."""
    try:
        return Path(inspect.getfile(law)).resolve()
    except (TypeError, OSError):
        return None


@contextmanager
def users_errors(path: Path | None) -> Iterator[None]:
    """Turns any exception of the block into a ControllerError with the user's file and line.

    This includes SystemExit: a user's code does not end the program that calls it.
    """
    try:
        yield
    except ControllerError:
        raise
    except (Exception, SystemExit) as error:
        raise _explained(error, path) from error


def _explained(error: Exception | SystemExit, path: Path | None) -> ControllerError:
    """Returns the error of a user's code as one sentence: where it arose, what it is, the line."""
    text = " ".join(str(error).split())
    where, line = str(path) if path else None, ""
    if isinstance(error, SyntaxError) and error.filename:
        where, line = f"{error.filename}, line {error.lineno}", error.text or ""
        text = error.msg
    else:
        frames = [
            frame
            for frame in traceback.extract_tb(error.__traceback__)
            if frame.filename != __file__ and not frame.filename.startswith("<frozen")
        ]
        own = [frame for frame in frames if path and Path(frame.filename).resolve() == path]
        for frame in (own or frames)[-1:]:  # none when our call or numpy refused the user's objects
            where = f"{frame.filename}, line {frame.lineno}, in {frame.name}"
            line = frame.line or ""
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    fix = f"correct the line `{line.strip()}`" if line.strip() else "correct the controller"
    if isinstance(error, SystemExit):
        fix = "a controller must not end the program: raise an exception instead"
    return ControllerError(what, fix=fix, where=where)
