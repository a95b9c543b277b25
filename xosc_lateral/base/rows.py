"""Rows of long runs, worked on in blocks: the scratch of one pass stays small however long a run is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK = 65_536
"""Rows that are worked on at a time where all of a long run would take much memory: half a megabyte each. [-]"""


def columns(n: int, parts: Iterable[Sequence[NDArray[Any]]]) -> list[NDArray[Any]]:
    """Columns of shape (n,) each, n at least 1; read-only, and no longer than one value, where all values are the same.

    `parts`: blocks of their rows in order, the same columns each time, shape (rows of the block,) each.
    """
    made: list[NDArray[Any]] = []
    begin = 0
    for part in parts:
        end = begin + len(part[0])
        made = made or [
            values if end == n and not _is_all(values, values[:1]) else values[:1].copy() for values in part
        ]
        for k, values in enumerate(part if end - begin < n else ()):
            if len(made[k]) == 1 and not _is_all(values, made[k]):
                column = np.empty(n, values.dtype)
                column[:begin] = made[k]
                made[k] = column
            if len(made[k]) == n:
                made[k][begin:end] = values
        begin = end
    return [values if len(values) == n else np.broadcast_to(values, n) for values in made]


def _is_all(values: NDArray[Any], first: NDArray[Any]) -> bool:
    """Whether all values are the first one to the bit: a negative zero is another."""
    bits = f"u{values.dtype.itemsize}"
    return bool((np.ascontiguousarray(values).view(bits) == first.view(bits)).all())


def blocks(n: int, begin: int = 0) -> Iterator[slice]:
    """Rows from `begin` to n, at most `BLOCK` at a time."""
    for first in range(begin, n, BLOCK):
        yield slice(first, min(first + BLOCK, n))


def rows_where(n: int, holds: Callable[[slice], NDArray[np.bool_]], begin: int = 0) -> NDArray[np.intp]:
    """Rows from `begin` to n where something holds, which is asked block by block."""
    parts = [np.flatnonzero(holds(rows)) + rows.start for rows in blocks(n, begin)]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)


def true_slices(mask: NDArray[np.bool_]) -> list[slice]:
    """The longest slices in which a mask, shape (n,), is True throughout, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def slices_where(n: int, holds: Callable[[slice], NDArray[np.bool_]], begin: int = 0) -> list[slice]:
    """The longest slices of rows from `begin` to n where something holds, which is asked block by block."""
    stretches: list[slice] = []
    for rows in blocks(n, begin):
        for part in true_slices(holds(rows)):
            first, stop = rows.start + part.start, rows.start + part.stop
            if stretches and stretches[-1].stop == first:
                first = stretches.pop().start
            stretches.append(slice(first, stop))
    return stretches
