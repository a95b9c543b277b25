"""The board as data: what each model scored, beside its floors, with intervals and ranks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.evaluation.realism import VarianceParts

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelScore:
    """One number of one model.

    Parameters
    ----------
    name : str
        Such as ``metrics, 10 s, same start``.
    unit : str
    value : float
        The model's, mean over the halves.
    floor : float
        Real against real, with as much known about the start. For `auc` 0.5 is as good as it gets.
    ranked : bool
        Whether it counts for the ranking.
    """

    name: str
    unit: str
    value: float
    floor: float
    ranked: bool = False

    @property
    def ratio(self) -> float:
        """Value over floor. [-]"""
        return self.value / self.floor if self.floor else float("nan")


@dataclass(frozen=True, eq=False)
class Row:
    """One model.

    Parameters
    ----------
    key, title, source, departures : str
        See `LateralModel`; `key` is its name on the command line.
    settings : mapping of str to float
        Numbers fitted on the first half.
    numbers : tuple of ModelScore
    variance : VarianceParts
        Of its free runs.
    score : float
        Geometric mean of the ranked numbers' ratios: 1 is as good as other real drivers. [-]
    low, high : float
        95 % interval of the score, vehicles resampled.
    rank, best_rank, worst_rank : int
        1: first; 95 % interval over the same resamples.
    group : int
        1: the first; within a group no model is told from the group's best by the resampled vehicles.
    scores_by_half : tuple of float
        Score on each half.
    example : array, shape (k, m)
        Windows sampled from the starts of `Board.example`. [m]
    spectrum : array, shape (bands,)
        Of its free runs. [m2/Hz]
    autocorrelation : array, shape (lags,)
    """

    key: str
    title: str
    source: str
    departures: str
    settings: Mapping[str, float]
    numbers: tuple[ModelScore, ...]
    variance: VarianceParts
    score: float
    low: float
    high: float
    rank: int
    best_rank: int
    worst_rank: int
    group: int
    scores_by_half: tuple[float, ...]
    example: FloatArray
    spectrum: FloatArray
    autocorrelation: FloatArray

    def number(self, name: str) -> ModelScore:
        """The number of that name; `KeyError` if it was not computed."""
        for one in self.numbers:
            if one.name == name:
                return one
        raise KeyError(name)


@dataclass(frozen=True, eq=False)
class Board:
    """All models, best first.

    Parameters
    ----------
    rows : tuple of Row
    absent : mapping of str to str
        Model -> why it is not on the board.
    vehicles, runs, hours, windows : int, int, float, mapping
        What was measured; windows by condition.
    unit : str
        What halves and resamples are made of: ``vehicle`` or ``block of 120 s``.
    tau : float
        Kendall's rank correlation between the two halves' rankings.
    pairs_apart, pairs_agreeing : int
        Pairs of models that the resampled vehicles tell apart, and those of them that both halves have in that order.
    resamples : int
    real_example, real_spectrum, frequency, real_autocorrelation, lags
        Real windows and curves beside the models'. [m], [m2/Hz], [Hz], [-], [s]
    real_variance : VarianceParts
    seed : int
    seconds : mapping of str to float
        Wall time by model: fit and samples, both halves. [s]
    """

    rows: tuple[Row, ...]
    absent: Mapping[str, str]
    vehicles: int
    runs: int
    hours: float
    windows: Mapping[str, int]
    unit: str
    tau: float
    pairs_apart: int
    pairs_agreeing: int
    resamples: int
    real_example: FloatArray
    real_spectrum: FloatArray
    frequency: FloatArray
    real_autocorrelation: FloatArray
    lags: FloatArray
    real_variance: VarianceParts
    seed: int
    seconds: Mapping[str, float] = field(default_factory=dict)
