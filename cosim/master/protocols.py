"""The interface of a plant that the master needs, which an FMU or a replacement implements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray


class Block(Protocol):
    """Variables of one type that are read or written in one call."""

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def values(self) -> NDArray[Any]: ...  # (n,) float64 or int32: the buffer of get and set
    def get(self) -> None: ...
    def set(self) -> None: ...


class Plant(Protocol):
    """What the master needs of a plant. Times are in s."""

    def names(self, causality: str, kind: str = "Real") -> list[str]: ...
    def block(self, names: Sequence[str], buffer: NDArray[Any] | None = None) -> Block: ...
    def parameters(self) -> dict[str, float]: ...
    def set_parameters(self, values: Mapping[str, Any]) -> None: ...
    def initialise(self, start: float, stop: float) -> None: ...
    def step(self, t: float, h: float) -> None: ...
