"""Measured snippets of one length as arrays, and the same snippets sampled from a profile.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: snippets of 10 s, each sampled one from its real one's start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.snippets import Snippet, cut_snippets, segment_of
from xosc_lateral.drives.drive import Run
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

BLOCK = 120.0
"""Where there are too few drives to split between them, blocks of this length are split instead. [s]"""

FEW_DRIVES = 6


@dataclass(frozen=True, eq=False)
class Snippets:
    """Snippets of measured driving.

    Parameters
    ----------
    seconds : float
        Their length. [s]
    items : tuple of Snippet
        Where each comes from.
    offset, lane_width : array, shape (n, m)
        [m]
    group : array of str, shape (n,)
        Drive, or block of a drive: what is split between halves, and resampled, as a whole.
    place : tuple of (int, slice)
        Number of the run, and rows in it.
    """

    seconds: float
    items: tuple[Snippet, ...]
    offset: FloatArray
    lane_width: FloatArray
    group: NDArray[np.str_]
    place: tuple[tuple[int, slice], ...]

    def __len__(self) -> int:
        return len(self.items)

    def take(self, rows: NDArray[np.int64]) -> Snippets:
        """Some of them. `rows` of shape (k,). [-]"""
        chosen = rows.tolist()
        return Snippets(
            self.seconds,
            tuple(self.items[row] for row in chosen),
            self.offset[rows],
            self.lane_width[rows],
            self.group[rows],
            tuple(self.place[row] for row in chosen),
        )

    @property
    def segments(self) -> list[Segment]:
        """Each with the context around it."""
        return [segment_of(one.run, one.rows) for one in self.items]

    def cut_from(self, paths: Sequence[FloatArray]) -> FloatArray:
        """The same snippets out of other paths of the same runs, shape (n, m). [m]"""
        return np.array([paths[number][rows] for number, rows in self.place]).reshape(self.offset.shape)


def snippets_of(runs: Sequence[Run], seconds: float, step: float, *, by_block: bool | None = None) -> Snippets:
    """All whole snippets, one after the other in each run, both ends counted (51 values for 10 s at 5 Hz).

    Parameters
    ----------
    by_block : bool, optional
        Whether groups are blocks of a drive; without, where there are fewer than `FEW_DRIVES` drives.
    """
    length = round(seconds / step) + 1
    items = tuple(cut_snippets(runs, seconds, step)) if any(len(run) >= length for run in runs) else ()
    groups = _groups(runs, items, seconds, by_block)
    numbers = {id(run): number for number, run in enumerate(runs)}
    return Snippets(
        seconds,
        items,
        np.array([one.offset for one in items]).reshape(-1, length),
        np.array([one.run.lane_width[one.rows] for one in items]).reshape(-1, length),
        np.array(groups, dtype=np.str_),
        tuple((numbers[id(one.run)], one.rows) for one in items),
    )


def _groups(runs: Sequence[Run], items: Sequence[Snippet], seconds: float, by_block: bool | None) -> list[str]:
    """What each snippet is judged with: its drive, or a block of it."""
    if by_block is None:
        by_block = len({run.drive for run in runs}) < FEW_DRIVES
    block = max(BLOCK, 2.0 * seconds)
    groups = [f"{one.run.drive} {int(one.time[0] // block)}" if by_block else one.run.drive for one in items]
    return groups
