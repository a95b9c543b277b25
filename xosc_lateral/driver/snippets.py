"""Snippets of measured runs, and sampled ones beside them; free runs under the context of measured drives.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: offsets are compared in snippets of equal length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

PAST, FUTURE = 30.0, 10.0
"""Context before and after a snippet that effects may look at. [s]"""


@dataclass(frozen=True, slots=True)
class Snippet:
    """A stretch of a run: `rows` of `run`, the `index`-th of its drive."""

    run: Run
    index: int
    rows: slice

    @property
    def time(self) -> FloatArray:
        """Shape (n,). [s]"""
        return self.run.time[self.rows]

    @property
    def offset(self) -> FloatArray:
        """As measured, positive left, shape (n,). [m]"""
        return self.run.offset[self.rows]


def cut_snippets(runs: Sequence[Run], seconds: float, step: float = STEP) -> list[Snippet]:
    """Successive snippets without overlap; each has ``seconds / step + 1`` rows and lies in one run.

    Raises `NotEnoughDataError` when no run is as long.
    """
    length = round(seconds / step) + 1
    if length < 2:
        raise ValueError(f"a snippet of {seconds} s holds no two steps of {step} s")
    snippets: list[Snippet] = []
    count: dict[str, int] = {}
    for run in runs:
        for first in range(0, len(run) - length + 1, length):
            index = count.get(run.drive, 0)
            snippets.append(Snippet(run, index, slice(first, first + length)))
            count[run.drive] = index + 1
    if not snippets:
        longest = max((len(run) for run in runs), default=0) * step
        raise NotEnoughDataError(f"the longest run lasts {longest:.1f} s, a snippet needs {seconds:g} s")
    return snippets


def segment_of(run: Run, rows: slice | None = None) -> Segment:
    """A run, or rows of it with the context around them, as the segment that is sampled on.

    Columns that are empty all along stay in the context: there is none, which is not the same as not being known.
    """
    first, last = (0, len(run)) if rows is None else (rows.start, rows.stop)
    begin = max(0, first - round(PAST / STEP))
    end = min(len(run), last + round(FUTURE / STEP))
    cut = slice(begin, end)
    speed = np.full(end - begin, np.nan) if run.speed is None else run.speed[cut]
    return Segment(
        time=run.time[cut],
        lane_width=run.lane_width[cut],
        speed=speed,
        context={name: np.full(end - begin, np.nan) for name in run.empty}
        | {name: values[cut] for name, values in run.context.items()},
        before=first - begin,
        after=end - last,
    )
