"""What class, lane and speed do to a population's level and spread, fitted before the rest.

Trucks, cars and lanes of one recording differ. What of it is beyond chance becomes effects of the profile, so that one
profile gives each its own, wherever class, lane and speed are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect, Levels, Linear, Piecewise
from xosc_lateral.driver.effects.rounding import rounded_number
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP

FloatArray = NDArray[np.float64]

LEAST_DRIVES = 30
"""Fewer are no population: whose lane it was, and who he is, can't be told apart. [-]"""

PIECE = 10.0
"""Snippets whose mean and spread are explained, the paper's. [s]"""

WITHIN = (0.05, 0.95)
"""Quantiles of the speed within which its effect is a straight line; beyond, it stays as it is there. [-]"""

RIGHTMOST = 0.0
"""Lane index with a level of its own; overtaking lanes share another."""


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Snippets of all runs: one observation each.

    Parameters
    ----------
    mean, spread : array, shape (n,)
        Of the offset; the logarithm of its standard deviation. [m], [-]
    quantities : array, shape (n, k)
        Mean of each quantity.
    drive : array of int, shape (n,)
    """

    mean: FloatArray
    spread: FloatArray
    quantities: FloatArray
    drive: NDArray[np.int64]


def fit_place(runs: Sequence[Run]) -> tuple[ColumnEffect, ...]:
    """Effects of class, lane and speed that are beyond chance; none where there are too few drives or columns.

    Drivers' own levels are a random effect, errors are robust against whatever else the snippets of one drive share,
    and a column is kept where that lowers Schwarz's criterion with the drives as the number of observations.

    References
    ----------
    .. [1] B. H. Baltagi, "Econometric Analysis of Panel Data", sections 2.3 and 2.4.2: random effects by a
       quasi-demeaned regression; errors clustered by individual.
    """
    shapes = _shapes(runs)
    if not shapes or len({run.drive for run in runs}) < LEAST_DRIVES:
        return ()
    pieces = _pieces(runs, shapes)
    found: list[ColumnEffect] = []
    for acts, observed in ((Acts.LOCATION, pieces.mean), (Acts.SPREAD, pieces.spread)):
        found += _kept(shapes, acts, observed, pieces)
    return tuple(found)


def without_place(runs: Sequence[Run], effects: Sequence[ColumnEffect]) -> list[Run]:
    """Runs as they would be with every column at its reference."""
    if not effects:
        return list(runs)
    return [_neutral(run, effects) for run in runs]


def _neutral(run: Run, effects: Sequence[ColumnEffect]) -> Run:
    location, log_factor = np.zeros(len(run)), np.zeros(len(run))
    for effect in effects:
        strength = effect.strength(STEP, run.context)
        if strength is not None and effect.acts is Acts.LOCATION:
            location += strength
        elif strength is not None:
            log_factor += strength
    moved = run.offset - location
    level = float(moved.mean())
    return replace(run, offset=level + (moved - level) * np.exp(-log_factor))


def _shapes(runs: Sequence[Run]) -> list[ColumnEffect]:
    """Effects without coefficients, of columns that all runs have and that vary."""
    shared = set.intersection(*(set(run.context) for run in runs)) if runs else set()
    columns = {
        name: np.concatenate([run.context[name] for run in runs])
        for name in ("is_truck", "lane_index", "speed")
        if name in shared
    }
    varying = {name for name, values in columns.items() if np.isfinite(values).all() and np.ptp(values) > 0.0}
    found: list[ColumnEffect] = []
    if "is_truck" in varying:
        found.append(Linear(acts=Acts.LOCATION, column="is_truck"))
    if "lane_index" in varying:
        found.append(Levels(acts=Acts.LOCATION, column="lane_index", levels=(RIGHTMOST,)))
    if "speed" in varying:
        low, high = (float(f"{value:.3g}") for value in np.quantile(columns["speed"], WITHIN))
        if high > low:
            found.append(Piecewise(acts=Acts.LOCATION, column="speed", knots=(low, high)))
    return found


def _quantity(effect: ColumnEffect, run: Run) -> FloatArray:
    """The one number that an effect goes by, shape (n,): of a speed, its place between the knots."""
    values = effect.quantity(run.context)
    return values[:, 1] - values[:, 2] if isinstance(effect, Piecewise) else values[:, 0]


def _pieces(runs: Sequence[Run], shapes: Sequence[ColumnEffect]) -> _Pieces:
    size = round(PIECE / STEP)
    number = {name: k for k, name in enumerate(dict.fromkeys(run.drive for run in runs))}
    mean, spread, rows, drive = [], [], [], []
    for run in runs:
        quantities = np.stack([_quantity(effect, run) for effect in shapes], axis=1)
        for first in range(0, len(run) - size + 1, size):
            piece = slice(first, first + size)
            mean.append(run.offset[piece].mean())
            spread.append(np.log(run.offset[piece].std() + 1e-6))
            rows.append(quantities[piece].mean(axis=0))
            drive.append(number[run.drive])
    shape = (len(rows), len(shapes))
    return _Pieces(np.array(mean), np.array(spread), np.array(rows).reshape(shape), np.array(drive, dtype=np.int64))


def _kept(shapes: Sequence[ColumnEffect], acts: Acts, observed: FloatArray, pieces: _Pieces) -> list[ColumnEffect]:
    """The least certain column is dropped until all left earn their place."""
    left = list(range(len(shapes)))
    drives = len(np.unique(pieces.drive))
    while left:
        slopes, errors = _regressed(observed, pieces.quantities[:, left], pieces.drive)
        certainty = (slopes / errors) ** 2
        worst = int(np.argmin(certainty))
        if certainty[worst] > np.log(drives):
            reference = pieces.quantities.mean(axis=0)
            return [
                _effect(shapes[k], acts, float(slope), float(error), float(reference[k]))
                for k, slope, error in zip(left, slopes, errors, strict=True)
            ]
        del left[worst]
    return []


def _regressed(observed: FloatArray, quantities: FloatArray, drive: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Slopes and their errors, shape (k,) each."""
    design = np.column_stack([np.ones(len(observed)), quantities])
    counts = np.bincount(drive).astype(np.float64)
    rest = observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0]
    own = np.bincount(drive, rest) / counts
    within = float(((rest - own[drive]) ** 2).sum() / max(len(rest) - len(counts), 1))
    between = max(float(rest.var()) - within, 0.0)
    theta = (1.0 - np.sqrt(within / (within + counts * between + 1e-30)))[drive]
    columns = [column - theta * (np.bincount(drive, column) / counts)[drive] for column in (*design.T, observed)]
    x, y = np.column_stack(columns[:-1]), columns[-1]
    inverse = np.linalg.pinv(x.T @ x)
    slopes = inverse @ x.T @ y
    scores = x * (y - x @ slopes)[:, None]
    by_drive = np.column_stack([np.bincount(drive, column) for column in scores.T])
    covariance = inverse @ (by_drive.T @ by_drive) @ inverse
    return slopes[1:], np.sqrt(np.maximum(np.diag(covariance)[1:], 1e-30))


def _effect(shape: ColumnEffect, acts: Acts, slope: float, error: float, reference: float) -> ColumnEffect:
    from msgspec.structs import replace as with_fields

    slope, error, reference = (rounded_number(value) for value in (slope, error, reference))
    if not isinstance(shape, Piecewise):
        return with_fields(shape, acts=acts, coefficients=(slope,), errors=(error,), reference=(reference,))
    # Flat, then a straight line between the knots, then flat; the reference is one place on it.
    return with_fields(
        shape,
        acts=acts,
        coefficients=(0.0, slope, -slope),
        errors=(0.0, error, error),
        reference=(0.0, reference, 0.0),
    )
