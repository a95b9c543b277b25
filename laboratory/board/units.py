"""Runs in two halves, by what is split and resampled as a whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.snippets import BLOCK_SECONDS, FEW_DRIVES

FloatArray = NDArray[np.float64]

LEAST_UNITS = 6
"""Vehicles, or blocks of two minutes, that two halves and a bootstrap over them need."""


def units_of(runs: Sequence[Run]) -> list[Run]:
    """Runs named by what is split and resampled: vehicles, or blocks of two minutes where there are few vehicles."""
    if len({run.drive for run in runs}) >= FEW_DRIVES:
        return list(runs)
    pieces = []
    for run in runs:
        block = (run.time // BLOCK_SECONDS).astype(np.int64)
        for number in np.unique(block):
            rows = np.flatnonzero(block == number)
            if len(rows) > 1:
                pieces.append(run.part(slice(int(rows[0]), int(rows[-1]) + 1), f"{run.drive} {number}"))
    return pieces


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
            f"{len(units)} vehicles (or blocks of {BLOCK_SECONDS:g} s) are left after cutting; {LEAST_UNITS} are "
            "needed to fit on one half and score on the other"
        )
    chosen = set(np.random.default_rng(seed).permutation(units)[: len(units) // 2].tolist())
    return [run for run in runs if run.drive in chosen], [run for run in runs if run.drive not in chosen]
