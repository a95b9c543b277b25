"""Hidden effects as they most likely were on measured drives: the latent paths that figures show beside the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.close import LoopResult
from xosc_lateral.identification.terms.base import latent_path
from xosc_lateral.identification.terms.cycle import CycleTerm
from xosc_lateral.identification.terms.regimes import RegimesTerm
from xosc_lateral.identification.terms.time import StepTerm, TimeMeanTerm
from xosc_lateral.identification.timeline import LOCAL_S, coarse_mean, coarse_middle, local_mean

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, slots=True)
class MovingStatistic:
    """A quantity of the longest drive over time, at 1 Hz, shape (n,) each; road-following seconds only.

    Parameters
    ----------
    time : array
        The drive's own clock. [s]
    measured, before, after : array
        Of the measured drive, and the mean over the profiles' runs. [m]
    """

    time: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray


def moving_mean(result: LoopResult, seconds: float) -> MovingStatistic:
    """Moving mean of the offset over so many `seconds` > 0. [m]"""
    timeline = result.scored.statistics.timeline

    def mean(offset: FloatArray) -> FloatArray:
        return coarse_mean(local_mean(offset, timeline.valid, seconds, timeline.step))

    return _statistic(result, mean(timeline.offset), *(mean(runs.mean(axis=0)) for runs in _runs(result)))


def moving_spread(result: LoopResult, seconds: float) -> MovingStatistic:
    """Root mean square of the movement faster than 20 s, over so many `seconds` > 0. [m]"""
    timeline = result.scored.statistics.timeline

    def squares(offset: FloatArray) -> FloatArray:
        fast = offset - local_mean(offset, timeline.valid, LOCAL_S, timeline.step)
        return local_mean(fast**2, timeline.valid, seconds, timeline.step)

    def spread(runs: FloatArray) -> FloatArray:
        return coarse_mean(np.sqrt(np.mean([squares(run) for run in runs], axis=0)))

    return _statistic(result, spread(timeline.offset[None]), *(spread(runs) for runs in _runs(result)))


def hidden_mean(result: LoopResult) -> FloatArray:
    """Step, drift and oscillation as fitted, about their mean; 0: none. [m] Shape as a `MovingStatistic`'s times."""
    coarse, fitted = result.coarse, result.final
    own = [term for term in fitted.terms if isinstance(term, CycleTerm | StepTerm | TimeMeanTerm)]
    hidden = np.sum([np.zeros(len(coarse)), *(latent_path(term, fitted) for term in own)], axis=0)
    return np.asarray((hidden - hidden[coarse.valid].mean())[_longest(result)])


def regime_probability(result: LoopResult) -> FloatArray:
    """Probability, 0 to 1, of the regime of large spread. [-] Shape as a `MovingStatistic`'s times."""
    fits = [term.fit.on for term in result.final.terms if isinstance(term, RegimesTerm)]
    on = fits[0] if fits else np.zeros(len(result.coarse))
    return np.asarray(on[_longest(result)])


def _runs(result: LoopResult) -> tuple[FloatArray, FloatArray]:
    return result.scored.runs_before, result.scored.runs_after


def _longest(result: LoopResult) -> BoolArray:
    """Valid seconds of the drive that has most of them."""
    coarse = result.coarse
    seconds = np.bincount(coarse.drive, coarse.valid.astype(np.float64))
    return np.asarray(coarse.valid & (coarse.drive == int(np.argmax(seconds))))


def _statistic(result: LoopResult, measured: FloatArray, before: FloatArray, after: FloatArray) -> MovingStatistic:
    shown = _longest(result)
    n = len(result.coarse)
    time = coarse_middle(result.scored.statistics.timeline.time)[:n]
    return MovingStatistic(time[shown], measured[shown], before[shown], after[shown])
