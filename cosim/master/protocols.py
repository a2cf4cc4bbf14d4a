"""The interfaces of plants and FMUs that the master needs, which replacements implement too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.typing import NDArray


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU."""

    name: str
    causality: str
    real: bool  # whether it is a floating-point variable
    flag: bool  # whether it is a Boolean variable
    size: int  # number of elements; 1 for a scalar


class Block(Protocol):
    """Variables of one type that are read or written in one call."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""

    @property
    def values(self) -> NDArray[Any]:
        """Buffer (n,) that get() fills and set() reads: float64 for Reals, else int32."""

    def get(self) -> None:
        """Reads all values from the plant. Raises FmuError."""

    def set(self) -> None:
        """Writes all values to the plant. Raises FmuError."""


class Plant(Protocol):
    """Interface of a plant that the master needs. Times are in s."""

    def names(self, causality: str, kind: str = "Real") -> list[str]:
        """Returns the names of all variables of a causality and FMI type."""

    def block(self, names: Sequence[str], buffer: NDArray[Any] | None = None) -> Block:
        """Returns a block of the named variables, with its values in `buffer` if given."""

    def parameters(self) -> dict[str, float]:
        """Returns the present values of all parameters."""

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Sets parameters by name, before `initialise`."""

    def initialise(self, start: float, stop: float) -> None:
        """Initialises the plant at time `start` [s]."""

    def step(self, t: float, h: float) -> None:
        """Steps from t to t + h [s]. Raises StepError."""
