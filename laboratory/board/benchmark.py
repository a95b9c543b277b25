"""Run the board: fit every model on half of the vehicles, score it on the other half, and the other way round."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from laboratory.board.contestants import Contestant, contestants
from laboratory.board.half import Half, make_half
from laboratory.board.numbers import floors_of, numbers_of
from laboratory.board.ranked import SHORT
from laboratory.board.ranking import RESAMPLES, bootstrap
from laboratory.board.result import Board
from laboratory.board.sampled_half import SampledHalf, sample_half
from laboratory.board.summary import make_board
from laboratory.board.units import halves, units_of
from xosc_lateral.base.errors import NotEnoughDataError, XoscLateralError
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.model.profile import DriverProfile

FloatArray = NDArray[np.float64]
Progress = Callable[[float, str], None]


def benchmark_realism(
    runs: Sequence[Run],
    *,
    models: Sequence[str] | None = None,
    profiles: Sequence[DriverProfile] = (),
    seed: int = 0,
    resamples: int = RESAMPLES,
    classify: bool = True,
    progress: Progress | None = None,
) -> Board:
    """Score models of the field on measured runs.

    Parameters
    ----------
    runs : sequence of Run
        Cut, at 5 Hz.
    models : sequence of str, optional
        Names in `MODELS`; without, all.
    profiles : sequence of DriverProfile
        Scored beside them, as they are.
    seed : int
        Same inputs and seed: same board.
    resamples : int
        Of the vehicles, for the intervals.
    classify : bool
        Train a classifier for each model (needs scikit-learn; minutes).
    progress : callable, optional
        Told the share that is done and what is being done.

    Raises
    ------
    NotEnoughDataError
        Fewer than six vehicles (or blocks of two minutes), or too few windows of 10 s.
    ValueError
        For a model that there is not, or one that comes twice.
    """
    entries = contestants(models, profiles)
    split = split_in_halves(runs, seed)
    sampled, absent, seconds = _sample_all(split, entries, seed, progress or (lambda share, what: None))
    parts = [(half, {key: ones[number] for key, ones in sampled.items()}) for number, half in enumerate(split)]
    by_half, drawn = bootstrap(parts, np.random.default_rng([seed, 2]), resamples)
    floors = floors_of(split, classify=classify)
    numbers = {key: numbers_of(parts, key, floors, classify=classify) for key in sampled}
    return make_board(runs, entries, parts, numbers, by_half, drawn, absent, seconds, seed)


def split_in_halves(runs: Sequence[Run], seed: int) -> list[Half]:
    """Each half of the vehicles to be scored on, the other to be fitted to.

    Raises
    ------
    NotEnoughDataError
        See `benchmark_realism`.
    """
    one, other = halves(units_of(runs), seed)
    rng = np.random.default_rng([seed, 1])
    split = [make_half(one, other, rng), make_half(other, one, rng)]
    if any(SHORT not in half.windows for half in split):
        raise NotEnoughDataError(f"fewer than 20 windows of {SHORT:g} s in half of the runs")
    return split


def fit_and_sample(entry: Contestant, half: Half, seed: Sequence[int]) -> SampledHalf:
    """A model fitted to the other vehicles of a half, sampled under the context of its own."""
    return sample_half(entry.fit(half.train), half, np.random.default_rng(seed))


def _sample_all(
    split: Sequence[Half], entries: Sequence[Contestant], seed: int, progress: Progress
) -> tuple[dict[str, list[SampledHalf]], dict[str, str], dict[str, float]]:
    """Fit and sample every model in both halves; what can't be had is said, not skipped."""
    sampled: dict[str, list[SampledHalf]] = {}
    absent: dict[str, str] = {}
    seconds: dict[str, float] = {}
    for number, entry in enumerate(entries):
        progress(number / len(entries), entry.title)
        begin = time.perf_counter()
        try:
            sampled[entry.key] = [
                fit_and_sample(entry, half, (seed, 3, number, which)) for which, half in enumerate(split)
            ]
        except XoscLateralError as error:
            absent[entry.key] = str(error)
        seconds[entry.key] = time.perf_counter() - begin
    return sampled, absent, seconds
