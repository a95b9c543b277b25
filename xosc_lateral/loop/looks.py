"""Where the loop looks for a column that acts: on the mean, the spread, the restoring strength, the fine noise.

Each look turns what the model leaves over into rows that would be white if nothing were left, and hands them to the
scan. The same scan with the model already holding the effect gives the null (a permutation under the full model [1]_):
an effect that is there does not widen the null that it is measured against.

References
----------
.. [1] C. J. F. ter Braak, "Permutation versus bootstrap significance tests in multiple regression and ANOVA", 1992.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, Linear
from xosc_lateral.loop.movement import CLIP, Coarse, Fitted, elapsed, own_levels, squared_innovations
from xosc_lateral.loop.noise import fit_autoregression, moving_sum, positions_in_stretch
from xosc_lateral.loop.scan import Rows
from xosc_lateral.loop.timeline import COARSE, coarse_all, coarse_mean

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FEW_DRIVES = 4
"""Up to this many drives their intercepts are terms of the scan; beyond, the calibration stands in for them."""

PULL_S = 3.0
"""Time over which the recent offset is averaged that the restoring acts on. [s]"""

FINE_ORDER = 15
"""Past samples (3 s) that the fine movement's autoregression sees."""

SLOW_S = 8
"""Whitened seconds that are averaged for the slower movement: below 1/16 Hz. [s]"""

KERNELS = ((-3.0, 2.0), (-1.5, 1.0), (1.5, 1.0), (3.0, 2.0), (0.0, 0.3), (0.0, 6.0))
"""Lags added and response times set [s], to stand for what a response fitted as a first-order lag leaves of its effect:
without them the rest would be blamed on whatever resembles the quantity."""

TAILS = (0.3, 4.0, 8.0)
"""Response times between which a lane change fades. [s]"""

NEUTRAL_FILTER = np.ones(1)


class Look(Enum):
    """Part of the movement that a column may act on."""

    LOCATION = "location"
    SPREAD = "scale"
    PACE = "dynamics"
    FINE = "fine"
    SLOW = "slow"


@dataclass(frozen=True, eq=False, slots=True)
class FineRows:
    """Squared innovations of the 0.2 s grid, averaged to 1 Hz and standardised.

    Parameters
    ----------
    squares : array, shape (n,)
        0 where invalid.
    valid : bool array, shape (n,)
    """

    squares: FloatArray
    valid: BoolArray


def look_rows(look: Look, coarse: Coarse, fitted: Fitted) -> Rows:
    """Rows for the scan."""
    if look is Look.LOCATION:
        return _location(coarse, fitted)
    if look is Look.PACE:
        return _pace(coarse, fitted)
    if look is Look.SPREAD:
        squares = squared_innovations(fitted.rows, coarse.valid)
        return _plain(squares, coarse.valid, fitted.scale_columns)
    if look is Look.SLOW:
        slow = slow_rows(coarse, fitted)
        return _plain(standardised(slow.squares, slow.valid), slow.valid, slow_columns(coarse, fitted))
    fine = fine_rows(coarse, fitted)
    known = fitted.terms.regime_scale
    # an effect on the mean is followed with errors of its own, the larger the more it moves the car
    moved = [np.abs(coarse.answer(effect)) for effect in fitted.terms.location]
    columns = np.concatenate(
        [fitted.scale_columns, *(coarse.answer(effect) for effect in fitted.terms.fine), *moved], axis=1
    )
    columns = columns if known is None else np.column_stack([columns, known])
    return _plain(fine.squares, fine.valid, columns)


def fine_rows(coarse: Coarse, fitted: Fitted, *, raw: bool = False) -> FineRows:
    """What the fine movement's innovations do, second by second; raw: mean squares as they are, not standardised."""
    timeline = coarse.timeline
    moved = np.where(timeline.valid, timeline.offset - _on_fine_grid(_explained(coarse, fitted), len(timeline)), 0.0)
    process = fit_autoregression(moved, timeline.valid, FINE_ORDER)
    innovations = moving_sum(process.polynomial, moved)
    whole = _settled(timeline.valid, process.order)
    squares = np.where(whole, np.minimum(innovations**2, CLIP), 0.0)
    valid = coarse_all(whole)
    mean = coarse_mean(squares)
    # sensors and drivers differ: what counts is what changes within a drive
    mean = mean / own_levels(mean, valid, coarse.drive)[coarse.drive]
    if raw:
        return FineRows(mean, valid)
    deviation = mean[valid].std() if valid.any() else 1.0
    centre = mean[valid].mean() if valid.any() else 0.0
    return FineRows(np.where(valid, (mean - centre) / max(deviation, 1e-12), 0.0), valid)


def slow_rows(coarse: Coarse, fitted: Fitted) -> FineRows:
    """Clipped squares of the slower movement, whitened, variance 1."""
    sums = moving_sum(np.ones(SLOW_S), fitted.rows)
    count = moving_sum(np.ones(SLOW_S), coarse.valid.astype(np.float64))
    valid = coarse.valid & (count >= SLOW_S - 0.5)
    slow = np.where(valid, sums, 0.0)
    deviation = float(slow[valid].std()) if valid.any() else 1.0
    return FineRows(np.where(valid, np.minimum((slow / max(deviation, 1e-12)) ** 2, CLIP), 0.0), valid)


def slow_columns(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """What is known of the slower movement's spread, shape (n, k)."""
    columns = [fitted.scale_columns, *(coarse.answer(effect) for effect in fitted.terms.slow)]
    if fitted.terms.slow_growth:
        columns.append(elapsed(coarse)[:, None])
    if fitted.terms.regime_scale is not None:
        columns.append(fitted.terms.regime_scale[:, None])
    return np.concatenate(columns, axis=1)


def standardised(squares: FloatArray, valid: BoolArray) -> FloatArray:
    """Mean 0 and variance 1 over the valid rows, 0 elsewhere."""
    return np.where(valid, (squares - squares[valid].mean()) / max(float(squares[valid].std()), 1e-12), 0.0)


def kernel_terms(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """Every location effect's quantity at other lags and response times, shape (n, k)."""
    variants = [
        coarse.answer(replace(effect, lag_s=effect.lag_s + lag, response_s=response))
        for effect in fitted.terms.location
        for lag, response in KERNELS
    ]
    if "lane_index" in coarse.context:
        variants += _lane_change_tails(coarse)
    return np.concatenate(variants, axis=1) if variants else np.zeros((len(coarse), 0))


def _lane_change_tails(coarse: Coarse) -> list[FloatArray]:
    """What is left of a lane change beyond the cut: answers to the lane that fade, and stand for no place in it."""
    lane = Linear(acts=Acts.LOCATION, column="lane_index")
    answers = [coarse.answer(replace(lane, response_s=response)) for response in TAILS]
    tails = [quick - slow for quick, slow in pairwise(answers)]
    return [tail for tail in tails if np.any(np.abs(tail[coarse.valid]) > 1e-6)]


def pull(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """Recent movement before each second, unit variance: what the driver steers back from; 0 where unknown."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / PULL_S))
    before = np.concatenate([[0.0], fitted.movement[:-1]])
    recent = np.asarray(lfilter([1.0 - keep], [1.0, -keep], before))
    recent = np.where(coarse.valid, recent, 0.0)
    return recent / max(float(recent[coarse.valid].std()), 1e-12)


def _location(coarse: Coarse, fitted: Fitted) -> Rows:
    whitener = fitted.whitener
    # rows near a cut are whitened by a filter of their own, which no shift-invariant formula knows: left out here
    settled = positions_in_stretch(coarse.valid) >= whitener.process.order
    groups = int(coarse.drive.max()) + 1
    own = (
        (coarse.drive[:, None] == np.arange(groups)).astype(np.float64)
        if groups <= FEW_DRIVES
        else np.zeros((len(coarse), 0))
    )
    known = np.concatenate([fitted.location_columns, kernel_terms(coarse, fitted), own], axis=1)
    terms = whitener.white(known) * settled[:, None]
    basis = _orthonormal(terms) if terms.shape[1] else terms
    rows = np.where(settled, fitted.rows, 0.0)
    rows = rows - basis @ (basis.T @ rows)
    taken = np.stack([whitener.adjoint(term) for term in basis.T]) if basis.shape[1] else np.zeros((0, len(coarse)))
    return Rows(whitener.adjoint(rows), settled / fitted.scale**2, taken, whitener.process.polynomial, rows)


def _pace(coarse: Coarse, fitted: Fitted) -> Rows:
    recent = pull(coarse, fitted)
    columns = [np.ones(len(coarse))] + [coarse.answer(effect)[:, 0] for effect in fitted.terms.pace]
    taken = _orthonormal(np.stack(columns, axis=1) * recent[:, None])
    rows = np.where(coarse.valid, fitted.rows, 0.0)
    rows = rows - taken @ (taken.T @ rows)
    # squares of the products themselves: a few loud seconds must not make a restoring strength
    return Rows(rows * recent, (rows * recent) ** 2, np.zeros((0, len(coarse))), NEUTRAL_FILTER, rows * recent)


def _plain(values: FloatArray, valid: BoolArray, columns: FloatArray) -> Rows:
    terms = np.concatenate([np.ones((len(values), 1)), columns], axis=1) * valid[:, None]
    taken = _orthonormal(terms)
    rows = values - taken @ (taken.T @ values)
    return Rows(rows, valid.astype(np.float64), taken.T, NEUTRAL_FILTER, rows)


def _explained(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """Offset less movement, at 1 Hz: intercepts and location terms; defined in the gaps too."""
    return fitted.location_columns @ fitted.location_sizes + fitted.intercepts[coarse.drive]


def _on_fine_grid(values: FloatArray, n: int) -> FloatArray:
    """From the middles of the seconds to the 0.2 s grid: steps of a second would look like fine movement."""
    return np.interp(np.arange(n), np.arange(len(values)) * COARSE + 0.5 * (COARSE - 1), values)


def _settled(valid: BoolArray, order: int) -> BoolArray:
    count = moving_sum(np.ones(order + 1), valid.astype(np.float64))
    return np.asarray(count > order + 0.5)


def _orthonormal(terms: FloatArray) -> FloatArray:
    basis, triangle = np.linalg.qr(terms)
    size = np.abs(np.diag(triangle))
    return np.asarray(basis[:, size > 1e-9 * max(float(size.max()), 1e-12)])
