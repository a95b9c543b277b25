"""What the measured drives show of effects: offsets by what drives one, and hidden ones over time.

References
----------
.. [1] W. A. Larsen, S. J. McCleary, "The use of partial residual plots in regression analysis", Technometrics 14, 1972.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.drivers.drives.filters import tapered_powers
from xosc_lateral.drivers.model.effects import Acts, Angular, ColumnEffect, Product
from xosc_lateral.extras.loop.close import LoopResult
from xosc_lateral.extras.loop.identify import hold_out_blocks
from xosc_lateral.extras.loop.terms.between import is_between
from xosc_lateral.extras.loop.terms.hidden import RegimesTerm
from xosc_lateral.extras.loop.timeline import LOCAL_S, Timeline, coarse_mean, coarse_middle, local_mean

POINTS = 9  # Equally wide bins between the 1 % and 99 % quantile of what drives an effect.
LEAST_S = 30  # A bin with less driving is left out. [s]


@dataclass(frozen=True, eq=False, slots=True)
class ContextCurve:
    """A fitted effect over what drives it, and what was measured there."""

    over: FloatArray  # shape (n,): The column, or the product, in its own unit.
    strength: FloatArray  # shape (n,): Fitted, with its standard error: [m], or a natural logarithm.
    error: FloatArray  # shape (n,)
    # shape (k,): Means of bins: where, how much, standard error from blocks. Empty where it can't be measured alone.
    seen: FloatArray
    measured: FloatArray
    measured_error: FloatArray


def curve_of(result: LoopResult, effect: ColumnEffect) -> ContextCurve:
    """Curve of an effect that was found, with measured points where it acts on mean, spread or fine noise."""
    over, strength, error = _fitted(result, effect)
    nothing = np.zeros(0)
    if effect.acts is Acts.RATE:
        return ContextCurve(over, strength, error, nothing, nothing, nothing)
    where, strengths = _driving(result, effect)
    inside = result.coarse.valid & np.isfinite(where)
    blocks = coarse_middle(hold_out_blocks(result.coarse.timeline))
    seen, mean, spread, fitted = _binned(where, _values(result, effect, inside), strengths, blocks, inside)
    if effect.acts is not Acts.LOCATION:
        mean, spread = 0.5 * np.log(np.maximum(mean, 1e-9)), 0.5 * spread / np.maximum(mean, 1e-9)
    # where the curve is zero is a matter of taste, so the points are shifted onto it as a whole
    shift = float(np.mean(fitted - mean)) if len(mean) else 0.0
    return ContextCurve(over, strength, error, seen, mean + shift, spread)


def _values(result: LoopResult, effect: ColumnEffect, inside: BoolArray) -> FloatArray:
    """What is measured of what the effect acts on, shape (n,): metres, or squares about 1.

    Of the movement within 20 s, or for fine noise from sample to sample.
    """
    coarse, fitted, timeline = result.coarse, result.final, result.coarse.timeline
    if effect.acts is Acts.LOCATION:  # less intercepts and all other effects on the mean
        rest = coarse.offset - fitted.columns @ fitted.sizes
        if is_between(effect):  # the places that the drives keep are what it explains
            return np.asarray(rest)
        return np.asarray(rest - fitted.levels[coarse.drive] + coarse_mean(coarse.strength(effect)))
    fine = effect.acts is Acts.FINE
    offset = timeline.offset
    squares = coarse_mean(np.square(np.diff(offset, prepend=offset[:1]) if fine else _fast(offset, timeline)))
    return squares / max(float(squares[inside].mean()), 1e-30)


def _fitted(result: LoopResult, effect: ColumnEffect) -> tuple[FloatArray, FloatArray, FloatArray]:
    coarse = result.coarse
    context = {column: coarse.context[column][coarse.timeline.valid] for column in effect.columns}
    seen = effect.seen(context)[:, 0] if _by_quantity(effect) else context[effect.columns[0]]
    seen = seen[np.isfinite(seen)]
    low, high = _ends(seen)
    over = np.linspace(low, high, 200)
    quantity = over[:, None] if _by_quantity(effect) else effect.quantity({effect.columns[0]: over})
    about = quantity - np.asarray(effect.reference)
    return over, about @ np.asarray(effect.coefficients), np.sqrt(about**2 @ np.square(effect.errors))


def _by_quantity(effect: ColumnEffect) -> bool:
    """Whether a curve is over the quantity: of a product, or of what is held."""
    return isinstance(effect, Product) or effect.episode > 0.0


def _ends(values: FloatArray) -> tuple[float, float]:
    """1 % and 99 % quantile; the extremes of what is nearly always the same."""
    low, high = np.quantile(values, [0.01, 0.99])
    return (float(low), float(high)) if low < high else (float(values.min()), float(values.max()))


def _driving(result: LoopResult, effect: ColumnEffect) -> tuple[FloatArray, FloatArray]:
    """Column (or product) as the driver responds to it, where that can be said, and the effect's strength; at 1 Hz."""
    coarse = result.coarse
    strength = coarse.strength(effect)
    if _by_quantity(effect):
        return coarse_mean(coarse.fine_response(effect)[:, 0]), coarse_mean(strength)
    column = coarse.context[effect.columns[0]]
    if isinstance(effect, Angular) or not np.isfinite(column).all():  # neither angles nor "none" can be averaged
        return coarse_middle(column), coarse_mean(strength)
    return coarse_mean(coarse.timeline.respond(column, effect.lag_s, effect.response_s)), coarse_mean(strength)


def _fast(offset: FloatArray, timeline: Timeline) -> FloatArray:
    """Movement within 20 s, shape (n,). [m]"""
    return offset - local_mean(offset, timeline.valid, LOCAL_S)


def _binned(
    where: FloatArray, values: FloatArray, strength: FloatArray, blocks: IndexArray, inside: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean place, mean value, its standard error with blocks as the independent pieces, mean of the fit, per bin."""
    low, high = _ends(where[inside])
    label = np.clip(((where - low) / max(high - low, 1e-12) * POINTS), 0, POINTS - 1)
    rows = []
    for index in range(POINTS):
        own_rows = np.flatnonzero(inside & (np.where(inside, label, -1.0).astype(int) == index))
        if len(own_rows) < LEAST_S:
            continue
        mean = float(values[own_rows].mean())
        together = np.bincount(blocks[own_rows], values[own_rows] - mean)
        error = float(np.sqrt(np.sum(together**2))) / len(own_rows)
        rows.append((float(where[own_rows].mean()), mean, error, float(strength[own_rows].mean())))
    columns = np.asarray(rows).reshape(-1, 4).T
    return columns[0], columns[1], columns[2], columns[3]


# ---- over time ----
@dataclass(frozen=True, eq=False, slots=True)
class MovingStatistic:
    """A quantity of the longest drive over time, at 1 Hz, shape (n,) each; road-following seconds only."""

    time: FloatArray  # The drive's own clock. [s]
    measured: FloatArray  # Of the measured drive, and the mean over the profiles' runs. [m]
    before: FloatArray
    after: FloatArray


def moving_mean(result: LoopResult, seconds: float) -> MovingStatistic:
    """Moving mean of the offset over so many `seconds` > 0. [m]"""
    return _moving(result, lambda runs: local_mean(runs.mean(axis=0), result.coarse.timeline.valid, seconds))


def moving_spread(result: LoopResult, seconds: float) -> MovingStatistic:
    """Root mean square of the movement faster than 20 s, over so many `seconds` > 0. [m]"""
    timeline = result.coarse.timeline

    def spread(runs: FloatArray) -> FloatArray:
        squares = [local_mean(_fast(run, timeline) ** 2, timeline.valid, seconds) for run in runs]
        return np.asarray(np.sqrt(np.mean(squares, axis=0)))

    return _moving(result, spread)


def _moving(result: LoopResult, statistic: Callable[[FloatArray], FloatArray]) -> MovingStatistic:
    """A statistic of runs, shape (runs, n), of the measured drives and of both profiles."""
    timeline, scored, shown = result.coarse.timeline, result.scored, _longest_run(result)
    runs = (timeline.offset[None], scored.runs_before, scored.runs_after)
    time = coarse_middle(timeline.time)[: len(result.coarse)]
    return MovingStatistic(time[shown], *(coarse_mean(statistic(own))[shown] for own in runs))


def hidden_mean(result: LoopResult) -> FloatArray:
    """Step, drift and oscillation as fitted, about their mean; 0: none. [m] Shape as a `MovingStatistic`'s times."""
    coarse, fitted = result.coarse, result.final
    paths = [fitted.path(term) for term in fitted.terms if not term.columns]
    hidden = np.sum([np.zeros(len(coarse)), *paths], axis=0)
    return np.asarray((hidden - hidden[coarse.valid].mean())[_longest_run(result)])


def regime_probability(result: LoopResult) -> FloatArray:
    """Probability, 0 to 1, of the regime of large spread. [-] Shape as a `MovingStatistic`'s times."""
    fits = [term.fit.on for term in result.final.terms if isinstance(term, RegimesTerm)]
    on = fits[0] if fits else np.zeros(len(result.coarse))
    return np.asarray(on[_longest_run(result)])


def _longest_run(result: LoopResult) -> BoolArray:
    """Valid seconds of the drive that has most of them."""
    coarse = result.coarse
    seconds = np.bincount(coarse.drive, coarse.valid.astype(np.float64))
    return np.asarray(coarse.valid & (coarse.drive == int(np.argmax(seconds))))


# ---- spectra of series with gaps and seams ----
MANY_SEGMENTS = 8  # With so many segments without a gap, spectra are taken from these only.


def gapped_spectrum(
    series: FloatArray, valid: BoolArray, seams: NDArray[np.intp], step: float, segment: int
) -> tuple[FloatArray, FloatArray, int]:
    """Frequency [Hz] and power density [m2/Hz] by Welch's method of series with gaps, and the number of segments.

    Segments of so many samples are mostly `valid` and lie in one part: runs, shape (runs, n) [m], are put together from
    parts with a jump between them, whose numbers are `seams`. NaN if no segment is long enough.
    """
    centred = np.where(valid, series - series[:, valid].mean(axis=1, keepdims=True), 0.0)
    window = np.hanning(segment)
    sums = np.zeros(segment // 2 + 1)
    starts = np.arange(0, valid.size - segment + 1, segment // 2)
    shares = np.array([float(valid[first : first + segment].mean()) for first in starts])
    usable = (shares > 0.8) & (seams[starts] == seams[starts + segment - 1])
    whole = usable & (shares == 1.0)
    chosen = np.flatnonzero(whole if whole.sum() >= MANY_SEGMENTS else usable)
    number = len(chosen)
    for index in chosen:
        rows = slice(starts[index], starts[index] + segment)
        sums += np.mean(tapered_powers(centred[:, rows], window), axis=0) / shares[index]
    frequency = np.asarray(np.fft.rfftfreq(segment, step), dtype=np.float64)
    density = 2.0 * step * sums / number / float(np.sum(window**2)) if number else np.full(len(frequency), np.nan)
    return frequency[1:], density[1:], number
