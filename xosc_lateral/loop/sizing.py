"""From what was traced to effects with sizes and standard errors, ready for a profile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import (
    Acts,
    ColumnEffect,
    Drift,
    Effect,
    GrowingSpread,
    Linear,
    Piecewise,
    Regimes,
    Saturating,
    Step,
    Threshold,
    Weave,
)
from xosc_lateral.loop.between import size_between
from xosc_lateral.loop.looks import SLOW_S, FineRows, fine_rows, pull, slow_rows
from xosc_lateral.loop.movement import DRIFT_TERMS, Coarse, Fitted, Terms, elapsed, fit_movement
from xosc_lateral.loop.regimes import fit_regimes

FloatArray = NDArray[np.float64]

FINE_TWIN_Z = 2.0
"""The fine noise follows an effect on the spread when it is that many standard errors from not doing so. [-]"""

MAX_LOG_PACE = float(np.log(3.0))
"""Largest change of the restoring strength between the 5 % and 95 % quantile that is believed. [-]"""

DRIFT_TIMES = (60.0, 100.0, 170.0, 300.0, 500.0, 900.0, 1600.0, 3000.0)
"""Correlation times tried for a drift. [s]"""


@dataclass(frozen=True, eq=False)
class Sized:
    """All effects of a model with their sizes.

    Parameters
    ----------
    groups : mapping of str to tuple of Effect
        Per finding what the profile gets: key "location 0", "scale 0", "weave", "step" ...; the first is the effect
        proper, further ones are what goes with it (fine noise beside spread).
    """

    groups: Mapping[str, tuple[Effect, ...]]

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All, in order."""
        return tuple(effect for group in self.groups.values() for effect in group)


def size_effects(coarse: Coarse, fitted: Fitted) -> Sized:
    """Sizes and errors of everything in the model."""
    terms = fitted.terms
    groups: dict[str, tuple[Effect, ...]] = {}
    errors = np.sqrt(np.maximum(np.diag(fitted.location_covariance), 0.0))
    at = 0
    for index, effect in enumerate(terms.location):
        width = coarse.answer(effect).shape[1]
        groups[f"location {index}"] = (
            _sized(coarse, effect, Acts.LOCATION, fitted.location_sizes[at : at + width], errors[at : at + width]),
        )
        at += width
    sizes, size_errors = size_between(coarse, fitted) if terms.between else (np.zeros(0), np.zeros(0))
    for index, effect in enumerate(terms.between):
        own = slice(index, index + 1)
        groups[f"between {index}"] = (_sized(coarse, effect, Acts.LOCATION, sizes[own], size_errors[own]),)
    groups |= _hidden_location(coarse, fitted, at, errors)
    needs_fine = terms.spread or terms.fine or terms.growth or terms.regime_scale is not None
    fine = fine_rows(coarse, fitted, raw=True) if needs_fine else None
    groups |= _scale_effects(coarse, fitted, fine)
    for index, effect in enumerate(terms.pace):
        groups[f"dynamics {index}"] = _pace_effects(coarse, fitted, effect)
    return Sized(groups)


def driving_range(coarse: Coarse, effect: ColumnEffect) -> tuple[FloatArray, FloatArray]:
    """Quantity at the low and at the high end of what drives the effect, shape (k,) each.

    That is the 5 % and the 95 % quantile while road-following: of the column, where a single number drives it; of the
    product; of the strength, for angles and levels. The extremes where both quantiles are the same (a switch that is on
    for less than 5 % of the time).
    """
    inside = coarse.timeline.valid
    if isinstance(effect, Linear | Threshold | Saturating | Piecewise):
        seen = coarse.context[effect.column][inside]
        ends = _ends(seen[np.isfinite(seen)])
        low, high = effect.quantity({effect.column: ends})
        if np.any(low != high):
            return low, high
    quantity = effect.quantity({column: coarse.context[column][inside] for column in effect.columns})
    quantity = quantity[np.isfinite(quantity).all(axis=1)]
    if quantity.shape[1] == 1:
        low, high = _ends(quantity[:, 0])
        return np.array([low]), np.array([high])
    order = np.argsort(quantity @ np.asarray(effect.coefficients))
    return quantity[order[int(0.05 * len(order))]], quantity[order[min(len(order) - 1, int(0.95 * len(order)))]]


def _ends(values: FloatArray) -> FloatArray:
    low, high = np.quantile(values, [0.05, 0.95])
    return np.array([low, high] if high > low else [values.min(), values.max()])


def span(coarse: Coarse, effect: ColumnEffect) -> float:
    """Change of strength between the two ends of the driving range; [m] or natural logarithm."""
    low, high = driving_range(coarse, effect)
    return float((high - low) @ np.asarray(effect.coefficients))


def _sized(coarse: Coarse, effect: ColumnEffect, acts: Acts, sizes: FloatArray, errors: FloatArray) -> ColumnEffect:
    raw = effect.answer(coarse.timeline.step, coarse.context)[coarse.timeline.valid]
    return replace(
        effect, acts=acts, coefficients=tuple(sizes), errors=tuple(errors), reference=tuple(raw.mean(axis=0))
    )


def _hidden_location(coarse: Coarse, fitted: Fitted, at: int, errors: FloatArray) -> dict[str, tuple[Effect, ...]]:
    terms, sizes = fitted.terms, fitted.location_sizes
    found: dict[str, tuple[Effect, ...]] = {}
    if terms.weave is not None:
        width = 2 * terms.weave_width * (int(coarse.drive.max()) + 1)
        found["weave"] = (_weave(coarse, terms, sizes[at : at + width], errors[at : at + width]),)
        at += width
    if terms.step_at is not None:
        before = coarse.valid & (np.arange(len(coarse)) < terms.step_at)
        found["step"] = (
            Step(
                size=float(sizes[at]),
                size_error=float(errors[at]),
                at_s=float(coarse.time[terms.step_at]),
                share_before=float(before.sum() / coarse.valid.sum()),
            ),
        )
        at += 1
    if terms.drift:
        found["drift"] = (_drift(coarse, fitted, slice(at, None)),)
    return found


def _weave(coarse: Coarse, terms: Terms, sizes: FloatArray, errors: FloatArray) -> Weave:
    drives = int(coarse.drive.max()) + 1
    power = max(float(np.sum(sizes**2) - np.sum(errors**2)) / drives, 1e-8)
    amplitude = float(np.sqrt(power))
    seconds = float(coarse.valid.sum()) / drives
    coherence = 1e6 if terms.weave_width == 1 else seconds / (np.pi * terms.weave_width)
    frequency = terms.weave or 1.0
    return Weave(
        amplitude=amplitude,
        amplitude_error=float(np.sqrt(np.mean(errors**2))),
        period_s=1.0 / frequency,
        coherence_s=float(coherence),
    )


def _drift(coarse: Coarse, fitted: Fitted, rows: slice) -> Drift:
    """Ornstein-Uhlenbeck process by maximum likelihood over the half cosines' sizes."""
    sizes, covariance = fitted.location_sizes[rows], fitted.location_covariance[rows, rows]
    errors = np.diag(covariance)
    duration = float(coarse.valid.sum()) / max(1, int(coarse.drive.max()) + 1)
    number = np.arange(len(sizes)) % DRIFT_TERMS + 1
    best = (-np.inf, 0.1, 300.0)
    for time in DRIFT_TIMES:
        # variance of the k-th half cosine's size: power density of the process at k / (2 T), two-sided, times 2 / T
        shape = 2.0 / duration * 2.0 * time / (1.0 + (np.pi * number / duration * time) ** 2)
        for size in np.geomspace(0.01, 2.0, 60):
            variance = size**2 * shape + errors
            likelihood = -0.5 * float(np.sum(sizes**2 / variance + np.log(variance)))
            if likelihood > best[0]:
                best = (likelihood, float(size), time)
    return Drift(size=best[1], size_error=best[1] / np.sqrt(2.0 * len(sizes)), correlation_s=best[2])


def _scale_effects(coarse: Coarse, fitted: Fitted, fine: FineRows | None) -> dict[str, tuple[Effect, ...]]:
    terms = fitted.terms
    errors = np.sqrt(np.maximum(np.diag(fitted.scale_covariance), 0.0))
    found: dict[str, tuple[Effect, ...]] = {}
    at = 0
    for index, effect in enumerate(terms.spread):
        width = coarse.answer(effect).shape[1]
        sizes = fitted.scale_sizes[at : at + width]
        spread = _sized(coarse, effect, Acts.SPREAD, sizes, errors[at : at + width])
        found[f"scale {index}"] = (spread, *_fine_twin(coarse, effect, fine))
        at += width
    for index, effect in enumerate(terms.fine):
        found[f"fine {index}"] = _fine_twin(coarse, effect, fine, always=True)
    if terms.growth:
        found["growth"] = (_growth(coarse, float(fitted.scale_sizes[at]), float(errors[at]), fine),)
    if terms.slow or terms.slow_growth:
        found |= _slow_effects(coarse, fitted)
    if terms.regime_scale is not None:
        found["regime"] = (_regimes(coarse, fitted, fine),)
    return found


def _slow_effects(coarse: Coarse, fitted: Fitted) -> dict[str, tuple[Effect, ...]]:
    """Spread of the slower movement, all jointly; neighbouring averages overlap, so errors are wider."""
    terms, slow = fitted.terms, slow_rows(coarse, fitted)
    blocks = [coarse.answer(effect) for effect in terms.slow]
    if terms.slow_growth:
        blocks.append(elapsed(coarse)[:, None])
    sizes, errors = log_sizes(slow.squares, slow.valid, np.concatenate(blocks, axis=1))
    errors = errors * np.sqrt(SLOW_S)
    found: dict[str, tuple[Effect, ...]] = {}
    at = 0
    for index, effect in enumerate(terms.slow):
        width = blocks[index].shape[1]
        own = slice(at, at + width)
        found[f"slow {index}"] = (_sized(coarse, effect, Acts.SPREAD, sizes[own], errors[own]),)
        at += width
    if terms.slow_growth:
        found["growth"] = (_growth(coarse, float(sizes[at]), float(errors[at]), None),)
    return found


def _fine_twin(
    coarse: Coarse, effect: ColumnEffect, fine: FineRows | None, *, always: bool = False
) -> tuple[ColumnEffect, ...]:
    if fine is None:
        return ()
    sizes, errors = log_sizes(fine.squares, fine.valid, coarse.answer(effect))
    if not always and float(np.max(np.abs(sizes) / np.maximum(errors, 1e-12))) < FINE_TWIN_Z:
        return ()
    return (_sized(coarse, effect, Acts.FINE, sizes, errors),)


def _growth(coarse: Coarse, size: float, error: float, fine: FineRows | None) -> GrowingSpread:
    time = elapsed(coarse)
    seen = coarse.time[coarse.valid]
    fine_size = 0.0 if fine is None else float(log_sizes(fine.squares, fine.valid, time[:, None])[0][0])
    factor = float(np.exp(size))
    return GrowingSpread(
        factor=factor,
        factor_error=factor * error,
        fine_factor=float(np.exp(fine_size)),
        from_s=float(seen.min()),
        to_s=float(seen.max()),
    )


def _regimes(coarse: Coarse, fitted: Fitted, fine: FineRows | None) -> Regimes:
    bare = fit_movement(coarse, replace(fitted.terms, regime_scale=None))
    fit = fit_regimes(bare.rows, coarse.valid)
    fine_size = 0.0 if fine is None else float(log_sizes(fine.squares, fine.valid, fit.on[:, None])[0][0])
    loud = float(np.sum(fit.on[coarse.valid]))
    # regimes are told by the innovations; what they do to the movement itself may be more
    slow = slow_rows(coarse, bare)
    moved = float(log_sizes(slow.squares, slow.valid, fit.on[:, None])[0][0])
    factor = max(float(np.exp(moved)), fit.factor)
    return Regimes(
        factor=factor,
        factor_error=factor / np.sqrt(2.0 * max(loud / SLOW_S, 1.0)),
        fine_factor=float(np.exp(fine_size)),
        on_s=fit.on_s,
        off_s=fit.off_s,
    )


def _pace_effects(coarse: Coarse, fitted: Fitted, effect: ColumnEffect) -> tuple[Effect, ...]:
    """Restoring strength: innovations stay the same, so a stronger pull also narrows the spread by its square root."""
    recent = pull(coarse, fitted)
    answer = coarse.answer(effect)[:, 0]
    inside = coarse.valid & np.concatenate([[False], coarse.valid[:-1]])
    design = np.stack([recent, recent * answer], axis=1)[inside]
    change = np.diff(fitted.movement, prepend=0.0)[inside] / fitted.whitener.process.deviations[-1]
    base = float(design[:, 0] @ change) / max(float(design[:, 0] @ design[:, 0]), 1e-12)
    inverse = np.linalg.pinv(design.T @ design)
    slope = float((inverse @ (design.T @ fitted.rows[inside]))[1])
    raw = effect.quantity({column: coarse.context[column] for column in effect.columns})[coarse.timeline.valid]
    low, high = np.nanquantile(raw, [0.05, 0.95])
    limit = MAX_LOG_PACE / max(float(high - low), 1e-12)
    size = float(np.clip(slope / min(base, -1e-3), -limit, limit))
    error = float(np.sqrt(inverse[1, 1])) / max(abs(base), 1e-3)
    pace = _sized(coarse, effect, Acts.RATE, np.array([size]), np.array([error]))
    return pace, replace(pace, acts=Acts.SPREAD, coefficients=(-0.5 * size,), errors=(0.5 * error,))


def log_sizes(squares: FloatArray, valid: NDArray[np.bool_], columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log-linear regression of a standard deviation on columns, from mean squares per second.

    Returns
    -------
    sizes, errors : array, shape (k,)
        Natural logarithm per unit.
    """
    design = columns[valid] - columns[valid].mean(axis=0)
    inverse = np.linalg.pinv(2.0 * design.T @ design)
    sizes = np.zeros(columns.shape[1])
    left = squares[valid]
    for _ in range(8):
        relative = left / np.exp(2.0 * design @ sizes)
        relative = relative / relative.mean()
        sizes = sizes + inverse @ (design.T @ (relative - 1.0))
    spread = float(np.std(relative))
    return sizes, np.sqrt(np.diag(inverse)) * spread / np.sqrt(2.0)
