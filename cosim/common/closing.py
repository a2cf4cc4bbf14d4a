"""The base class of objects that a with statement closes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self


class Closing(ABC):
    """An object that holds resources until close() or the end of its with statement."""

    @abstractmethod
    def close(self) -> None:
        """Releases the resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
