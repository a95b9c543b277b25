"""Runs in two halves, and the windows that measured, sampled and other people's driving are compared on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.snippets import cut_snippets, segment_of
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.evaluation.snippets import BLOCK, FEW_DRIVES
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

LEAST_UNITS = 6
"""Vehicles, or blocks of two minutes, that two halves and a bootstrap over them need."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of one length.

    Parameters
    ----------
    seconds : float
    offset, lane_width : array, shape (n, m)
        [m]
    unit : array of str, shape (n,)
        Vehicle, or block of a drive: what is resampled as a whole.
    segments : list of Segment
        Each with the context around it.
    place : list of (int, slice)
        Number of the run, and rows in it.
    """

    seconds: float
    offset: FloatArray
    lane_width: FloatArray
    unit: NDArray[np.str_]
    segments: list[Segment]
    place: list[tuple[int, slice]]

    def __len__(self) -> int:
        return len(self.unit)

    def cut_from(self, paths: Sequence[FloatArray]) -> FloatArray:
        """The same windows out of other paths of the same runs, shape (n, m). [m]"""
        return np.array([paths[number][rows] for number, rows in self.place])


def windows_of(runs: Sequence[Run], seconds: float) -> Windows | None:
    """All whole windows one after another; None if no run is as long."""
    if not any(len(run) > round(seconds / STEP) for run in runs):
        return None
    numbers = {id(run): number for number, run in enumerate(runs)}
    items = cut_snippets(runs, seconds, STEP)
    return Windows(
        seconds,
        np.array([item.offset for item in items]),
        np.array([item.run.lane_width[item.rows] for item in items]),
        np.array([item.run.drive for item in items], dtype=np.str_),
        [segment_of(item.run, item.rows) for item in items],
        [(numbers[id(item.run)], item.rows) for item in items],
    )


def units_of(runs: Sequence[Run]) -> list[Run]:
    """Runs named by what is split and resampled: vehicles, or blocks of two minutes where there are few vehicles."""
    if len({run.drive for run in runs}) >= FEW_DRIVES:
        return list(runs)
    pieces = []
    for run in runs:
        block = (run.time // BLOCK).astype(np.int64)
        for number in np.unique(block):
            rows = np.flatnonzero(block == number)
            if len(rows) > 1:
                pieces.append(_piece(run, slice(int(rows[0]), int(rows[-1]) + 1), f"{run.drive} {number}"))
    return pieces


def _piece(run: Run, rows: slice, name: str) -> Run:
    context: Mapping[str, FloatArray] = {key: values[rows] for key, values in run.context.items()}
    return replace(
        run,
        drive=name,
        time=run.time[rows],
        offset=run.offset[rows],
        lane_width=run.lane_width[rows],
        context=context,
    )


def halves(runs: Sequence[Run], seed: int) -> tuple[list[Run], list[Run]]:
    """Runs of two random halves of the units.

    Raises
    ------
    NotEnoughDataError
        With fewer than `LEAST_UNITS`.
    """
    units = sorted({run.drive for run in runs})
    if len(units) < LEAST_UNITS:
        raise NotEnoughDataError(
            f"{len(units)} vehicles (or blocks of {BLOCK:g} s) are left after cutting; {LEAST_UNITS} are needed to fit "
            "on one half and score on the other"
        )
    chosen = set(np.random.default_rng(seed).permutation(units)[: len(units) // 2].tolist())
    return [run for run in runs if run.drive in chosen], [run for run in runs if run.drive not in chosen]
