"""What the loop has explained so far, and the fit of all of it together.

offset = intercept of the drive + location terms + scale * movement, with the movement an autoregression at 1 Hz, and
every drive's scale about its own level: drivers differ in both. All
location terms are fitted jointly by generalised least squares, all scale terms jointly by iterated regression of the
squared innovations: adding an effect corrects the ones found before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect
from xosc_lateral.loop.noise import Autoregression, Whitener, fit_autoregression
from xosc_lateral.loop.timeline import Timeline, coarse_all, coarse_mean, coarse_middle

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ORDER = 12
"""Past seconds that the movement's autoregression sees."""

CLIP = 9.0
"""Squared innovations (variance 1) beyond this count as this: three standard deviations. [-]"""

DRIFT_TERMS = 8
"""Half cosines over a drive that stand for a slow drift while other effects are looked for."""

OWN_LEVEL_S = 30.0
"""A drive's level of the scale is its own as far as it lasts longer than this. [s]"""

MIN_DRIFT_S = 600.0
"""A shorter drive tells nothing about drift or growing spread. [s]"""


@dataclass(frozen=True, eq=False)
class Coarse:
    """The timeline at 1 Hz, and every column effect's answer on it.

    Parameters
    ----------
    timeline : Timeline
    offset : array, shape (n,)
        Mean of each second. [m]
    valid : bool array, shape (n,)
    drive : int array, shape (n,)
    time : array, shape (n,)
        [s]
    context : mapping of str to array
        Columns on the fine grid, lane width included, clipped to what occurs while road-following: a traffic jam that
        is cut out must not stretch a column's range.
    """

    timeline: Timeline
    offset: FloatArray
    valid: BoolArray
    drive: IntArray
    time: FloatArray
    context: Mapping[str, FloatArray]
    _answers: dict[ColumnEffect, FloatArray] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, timeline: Timeline) -> Coarse:
        """Average to 1 Hz."""
        return cls(
            timeline,
            coarse_mean(timeline.offset),
            coarse_all(timeline.valid),
            coarse_middle(timeline.drive),
            coarse_mean(timeline.time),
            {
                name: _within(values, timeline.valid)
                for name, values in {"lane_width": timeline.lane_width, **timeline.context}.items()
            },
        )

    def __len__(self) -> int:
        return len(self.offset)

    @property
    def lasts(self) -> bool:
        """Whether a drive is long enough to change with time: minutes, not the minute of a passing vehicle."""
        return bool(np.bincount(self.drive, self.valid.astype(float)).max() >= MIN_DRIFT_S)

    def answer(self, effect: ColumnEffect, *, keep: bool = False) -> FloatArray:
        """The effect's quantity as the driver answers to it, less its mean where valid; shape (n, k)."""
        key = _bare(effect)
        if key in self._answers:
            return self._answers[key]
        answer = coarse_mean(key.answer(self.timeline.step, self.context))
        answer = answer - answer[self.valid].mean(axis=0)
        if keep:
            self._answers[key] = answer
        return np.asarray(answer, dtype=np.float64)

    def drift_terms(self) -> FloatArray:
        """Half cosines over every drive that lasts long enough, shape (n, terms)."""
        columns = []
        for index in range(int(self.drive.max()) + 1):
            rows = np.flatnonzero(self.drive == index)
            inside = rows[self.valid[rows]]
            if len(inside) < MIN_DRIFT_S:
                continue
            share = np.clip((rows - inside[0]) / (inside[-1] - inside[0]), 0.0, 1.0)
            for term in range(1, DRIFT_TERMS + 1):
                column = np.zeros(len(self))
                column[rows] = np.cos(np.pi * term * share)
                columns.append(column)
        return np.stack(columns, axis=1) if columns else np.zeros((len(self), 0))


def _within(values: FloatArray, valid: BoolArray) -> FloatArray:
    seen = values[valid & np.isfinite(values)]
    return np.clip(values, seen.min(), seen.max()) if len(seen) else values


def _bare(effect: ColumnEffect) -> ColumnEffect:
    return replace(effect, acts=Acts.LOCATION, coefficients=(), errors=(), reference=())


@dataclass(frozen=True, eq=False)
class Terms:
    """Effects in the model, without their sizes.

    Parameters
    ----------
    location, spread, pace, fine, slow : tuple of ColumnEffect
        `slow` act on the spread of the slower movement only: more is let pass, but what is done is done as always.
    between : tuple of ColumnEffect
        Go with the places that different drives keep; the drives' intercepts hold them.
    weave : float, optional
        Frequency of a swing. [1/s]
    weave_width : int
        Number of neighbouring frequencies that it takes: its phase wanders.
    step_at : int, optional
        Coarse row at which the mean jumps.
    drift : bool
        Whether slow drift is taken out.
    growth, slow_growth : bool
        Whether the spread, or that of the slower movement only, changes steadily with time.
    order : int
        Of the autoregression.
    regime_scale : array, shape (n,), optional
        Logarithm of the spread that the on/off regimes give, as far as they can be told.
    """

    location: tuple[ColumnEffect, ...] = ()
    spread: tuple[ColumnEffect, ...] = ()
    pace: tuple[ColumnEffect, ...] = ()
    fine: tuple[ColumnEffect, ...] = ()
    slow: tuple[ColumnEffect, ...] = ()
    between: tuple[ColumnEffect, ...] = ()
    weave: float | None = None
    weave_width: int = 1
    step_at: int | None = None
    drift: bool = False
    growth: bool = False
    slow_growth: bool = False
    order: int = ORDER
    regime_scale: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Fitted:
    """Terms with sizes, and what is left.

    Parameters
    ----------
    terms : Terms
    whitener : Whitener
    location_columns : array, shape (n, k)
        Location terms: effects in order, the step, the drift.
    location_sizes, location_covariance : array, shape (k,), (k, k)
        [m] per unit.
    intercepts : array, shape (drives,)
        Mean offset of every drive where all location terms are at their mean. [m]
    scale_columns : array, shape (n, j)
        Spread effects in order, then time.
    scale_sizes, scale_covariance : array, shape (j,), (j, j)
        Natural logarithm per unit.
    rows : array, shape (n,)
        Whitened residual, variance 1, 0 where invalid.
    movement : array, shape (n,)
        Offset less intercept and location terms, over the scale; 0 where invalid. [m]
    log_likelihood : float
        Gaussian, of the valid rows.
    """

    terms: Terms
    whitener: Whitener
    location_columns: FloatArray
    location_sizes: FloatArray
    location_covariance: FloatArray
    intercepts: FloatArray
    scale_columns: FloatArray
    scale_sizes: FloatArray
    scale_covariance: FloatArray
    rows: FloatArray
    movement: FloatArray
    log_likelihood: float

    @property
    def scale(self) -> FloatArray:
        """Factor on the movement, shape (n,)."""
        return self.whitener.scale


def fit_movement(coarse: Coarse, terms: Terms, *, process: Autoregression | None = None) -> Fitted:
    """Fit everything in `terms` jointly.

    Parameters
    ----------
    coarse : Coarse
    terms : Terms
    process : Autoregression, optional
        Keep this one instead of fitting it.
    """
    columns, scales = location_columns(coarse, terms), scale_columns(coarse, terms)
    sizes, log_sizes = np.zeros(columns.shape[1]), np.zeros(scales.shape[1])
    covariance = np.zeros((len(sizes), len(sizes)))
    intercepts = np.zeros(int(coarse.drive.max()) + 1)
    fixed = process
    level = np.ones(len(intercepts))
    scale = np.ones(len(coarse))
    rows = movement = np.zeros(len(coarse))
    for attempt in range(4):
        scale = np.exp(scales @ log_sizes + (0.0 if terms.regime_scale is None else terms.regime_scale))
        scale = scale * level[coarse.drive]
        left = np.where(coarse.valid, coarse.offset - columns @ sizes, 0.0)
        if attempt == 0:
            intercepts = _group_means(left, coarse)
        movement = np.where(coarse.valid, (left - intercepts[coarse.drive]) / scale, 0.0)
        noise = fixed or fit_autoregression(movement, coarse.valid, terms.order)
        whitener = Whitener(noise, coarse.valid, coarse.drive, scale)
        response, design = whitener.rows(coarse.offset), whitener.rows(columns)
        sizes, covariance = _least_squares(design, response)
        rows = response - design @ sizes
        intercepts = _intercepts(whitener, np.where(coarse.valid, coarse.offset - columns @ sizes, 0.0))
        if scales.shape[1]:
            log_sizes = log_sizes + _log_scale_step(scales, rows, coarse)
        level = level * np.sqrt(own_levels(_clipped_squares(rows, coarse.valid), coarse.valid, coarse.drive))
    scale_covariance = _scale_covariance(scales, coarse)
    n = int(coarse.valid.sum())
    variance = float(rows @ rows) / max(1, n - len(sizes))
    likelihood = -0.5 * float(rows @ rows) - n * np.log(noise.deviations[-1]) - float(np.log(scale[coarse.valid]).sum())
    left = np.where(coarse.valid, coarse.offset - columns @ sizes - intercepts[coarse.drive], 0.0)
    return Fitted(
        terms, whitener, columns, sizes, covariance * variance, intercepts, scales, log_sizes, scale_covariance,
        rows / np.sqrt(variance), left / scale, likelihood,
    )  # fmt: skip


def held_out_likelihood(coarse: Coarse, fitted: Fitted, held: BoolArray) -> float:
    """Gaussian log-likelihood of the valid rows in `held`, shape (n,), under a model fitted without them.

    Places that drives keep are taken from the held-out rows themselves. Fine noise, restoring strength and the slower
    movement's spread are no part of it.
    """
    rows = coarse.valid & held
    whitener = Whitener(fitted.whitener.process, rows, coarse.drive, fitted.scale)
    left = coarse.offset - location_columns(coarse, fitted.terms) @ fitted.location_sizes
    white = whitener.rows(np.where(rows, left, 0.0))
    level = float(rows.sum()) * np.log(whitener.process.deviations[-1])
    return float(-0.5 * (white @ white) - level - np.log(fitted.scale[rows]).sum())


def location_columns(coarse: Coarse, terms: Terms) -> FloatArray:
    """Design of the mean: effects, step, drift; shape (n, k)."""
    blocks = [coarse.answer(effect, keep=True) for effect in terms.location]
    if terms.weave is not None:
        blocks.append(weave_terms(coarse, terms.weave, terms.weave_width))
    if terms.step_at is not None:
        blocks.append((np.arange(len(coarse)) >= terms.step_at).astype(np.float64)[:, None])
    if terms.drift:
        blocks.append(coarse.drift_terms())
    return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(coarse), 0))


def weave_terms(coarse: Coarse, frequency: float, width: int) -> FloatArray:
    """Cosines and sines of `width` neighbouring frequencies, for each drive, shape (n, 2 * width * drives)."""
    columns = []
    for index in range(int(coarse.drive.max()) + 1):
        rows = coarse.drive == index
        n = int(rows.sum())
        for offset in range(width):
            angle = 2.0 * np.pi * np.arange(n) * (frequency + (offset - width // 2) / n)
            for swing in (np.cos(angle), np.sin(angle)):
                column = np.zeros(len(coarse))
                column[rows] = swing
                columns.append(column)
    return np.stack(columns, axis=1)


def scale_columns(coarse: Coarse, terms: Terms) -> FloatArray:
    """Design of the log scale: spread effects, time; shape (n, j)."""
    blocks = [coarse.answer(effect, keep=True) for effect in terms.spread]
    if terms.growth:
        blocks.append(elapsed(coarse)[:, None])
    return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(coarse), 0))


def elapsed(coarse: Coarse) -> FloatArray:
    """Time on the road, -0.5 at the start and 0.5 at the end of each drive's valid part; shape (n,)."""
    share = np.zeros(len(coarse))
    for index in range(int(coarse.drive.max()) + 1):
        rows = np.flatnonzero(coarse.drive == index)
        inside = rows[coarse.valid[rows]]
        if len(inside):
            share[rows] = np.clip((rows - inside[0]) / max(1, inside[-1] - inside[0]), 0.0, 1.0) - 0.5
    return share


def squared_innovations(rows: FloatArray, valid: BoolArray) -> FloatArray:
    """Clipped squares, standardised over the valid rows; 0 elsewhere."""
    squares = np.minimum(rows**2, CLIP)
    mean, deviation = squares[valid].mean(), squares[valid].std()
    return np.where(valid, (squares - mean) / max(deviation, 1e-12), 0.0)


def _group_means(values: FloatArray, coarse: Coarse) -> FloatArray:
    groups = int(coarse.drive.max()) + 1
    count = np.bincount(coarse.drive, coarse.valid.astype(float), minlength=groups)
    return np.bincount(coarse.drive, np.where(coarse.valid, values, 0.0), minlength=groups) / np.maximum(count, 1.0)


def _intercepts(whitener: Whitener, left: FloatArray) -> FloatArray:
    ones, white = whitener.white(np.ones(len(left))), whitener.white(left)
    groups = int(whitener.drive.max()) + 1
    power = np.bincount(whitener.drive, ones**2, minlength=groups)
    return np.bincount(whitener.drive, ones * white, minlength=groups) / np.maximum(power, 1e-300)


def _least_squares(design: FloatArray, response: FloatArray) -> tuple[FloatArray, FloatArray]:
    if design.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0))
    inverse = np.linalg.pinv(design.T @ design)
    return inverse @ (design.T @ response), np.asarray(inverse, dtype=np.float64)


def own_levels(squares: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """Mean square of every drive over that of all, shape (drives,); 1 for a single drive, near 1 for short ones."""
    groups = int(drive.max()) + 1
    if groups == 1:
        return np.ones(1)
    relative = squares / max(float(squares[valid].mean()), 1e-300)
    seconds = np.bincount(drive, valid.astype(float), minlength=groups)
    sums = np.bincount(drive, np.where(valid, relative, 0.0), minlength=groups)
    return np.asarray((sums + OWN_LEVEL_S) / (seconds + OWN_LEVEL_S))


def _clipped_squares(rows: FloatArray, valid: BoolArray) -> FloatArray:
    return np.asarray(np.minimum(np.square(rows) / np.mean(rows[valid] ** 2), CLIP))


def _within_drives(scales: FloatArray, coarse: Coarse) -> FloatArray:
    """Valid rows of the scale's design about their drive's mean."""
    means = np.stack([_group_means(column, coarse) for column in scales.T], axis=1)
    return np.asarray((scales - means[coarse.drive])[coarse.valid])


def _log_scale_step(scales: FloatArray, rows: FloatArray, coarse: Coarse) -> FloatArray:
    """One Fisher-scoring step for log sd = scales . sizes (variance of a squared normal is 2)."""
    variance = np.minimum(rows[coarse.valid] ** 2, CLIP)
    design = _within_drives(scales, coarse)
    return np.asarray(np.linalg.pinv(2.0 * design.T @ design) @ (design.T @ (variance / variance.mean() - 1.0)))


def _scale_covariance(scales: FloatArray, coarse: Coarse) -> FloatArray:
    if scales.shape[1] == 0:
        return np.zeros((0, 0))
    design = _within_drives(scales, coarse)
    return np.asarray(np.linalg.pinv(2.0 * design.T @ design))
