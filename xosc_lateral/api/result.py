"""What all results have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


class Result(ABC):
    """A result: a line as its `repr`, the command line's text as its `str`, a table, and JSON values."""

    __slots__ = ()

    @abstractmethod
    def headline(self) -> str:
        """One line."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.headline()}>"

    @abstractmethod
    def __str__(self) -> str: ...

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """As a table."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
