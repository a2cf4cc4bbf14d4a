"""Saves and restores the states of the controller's parts."""

from __future__ import annotations

from typing import Any, ClassVar


class Stateful:
    """A part with a state: the attributes that STATE names.

    A step assigns new values to these attributes and never changes a value in place, so that a
    saved state stays as it was.
    """

    STATE: ClassVar[tuple[str, ...]] = ()

    def save(self) -> dict[str, Any]:
        """Returns the state that restore() takes."""
        values = {name: getattr(self, name) for name in self.STATE}
        return {
            name: value.save() if isinstance(value, Stateful) else value
            for name, value in values.items()
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save()."""
        for name, value in state.items():
            part = getattr(self, name)
            if isinstance(part, Stateful):
                part.restore(value)
            else:
                setattr(self, name, value)
