"""What an attack needs to know about a reader, and what it takes for nonsense."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.limits import DISTANCES, context_range


class NonsenseError(AssertionError):
    """Accepted, and it should not have been."""


@dataclass(frozen=True)
class Reader:
    """A reader under attack.

    Parameters
    ----------
    name : str
    seeds : callable
        Folder -> good files that are made there; each of them is mutated.
    use : callable
        Reads a file and does with it what a user would.
    share : float
        Of the mutants that the others get: one that takes long gets fewer.
    needs : str
        Package of an extra, without which it can't be attacked.
    """

    name: str
    seeds: Callable[[Path], Iterable[Path]]
    use: Callable[[Path], object]
    share: float = 1.0
    needs: str = ""


def sane(values: object, low: float, high: float, what: str) -> None:
    """Raise `NonsenseError` for what is not within the limits, or not finite."""
    array = np.asarray(values, dtype=np.float64)
    if array.size and not (np.isfinite(array).all() and array.min() >= low and array.max() <= high):
        raise NonsenseError(f"{what}: {array.min()} to {array.max()}")


def sane_table(table: object) -> None:
    """The same for a drive table."""
    for name in table.columns:  # type: ignore[attr-defined]
        column = table[name]  # type: ignore[index]
        if column.dtype.kind in "fiu":
            believed = context_range(name)
            low, high = (-1e10, 1e10) if name == "time" else (believed.low, believed.high)
            values = column.to_numpy(dtype=np.float64)
            said = ~np.isnan(values) & ~(np.isposinf(values) & (name in DISTANCES))  # nobody within reach
            sane(values[said], low, high, str(name))


def refusal_of(use: Callable[[Path], object], path: Path) -> str:
    """The line that a reader refuses a file with; empty if it takes it. Anything else comes through."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            use(path)
        except XoscLateralError as error:
            return str(error)
    return ""
