"""Says why a controller is replaced while the robot is live."""

from __future__ import annotations

import signal
import traceback

from hexapod_cosim.models import HexapodError


def text_of(error: BaseException) -> str:
    """Returns what happened in a controller, in a sentence.

    Raises the KeyboardInterrupt of Ctrl-C again. The loop's process ignores Ctrl-C, so there a
    controller has raised it.
    """
    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    if isinstance(error, KeyboardInterrupt) and not ignored:
        raise error
    if isinstance(error, HexapodError):
        return str(error)
    name, text = type(error).__name__, str(error)
    told = f"{name}: {text}" if text else name
    if isinstance(error, Exception):
        return told
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{place.filename}, line {place.lineno}, in {place.name}"
    return f"{where}: {told}; a controller must not end the program"
