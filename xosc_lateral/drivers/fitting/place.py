"""What class, lane and speed do to a population's level, spread and fine movement, fitted before the rest.

Trucks, cars and lanes of one recording differ. What of it is beyond chance becomes effects of the profile, so that one
profile gives each its own, wherever class, lane and speed are known. What neighbours do to the level is fitted along
with them where they are known (`neighbours`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec.structs import replace as with_fields

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.numbers import all_significant
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.fitting.neighbours import NEIGHBOURS, SCALE, most_beside, neighbour_shapes
from xosc_lateral.drivers.fitting.regression import clustered_least_squares
from xosc_lateral.drivers.model.core.autoregressive.coarse import split_bands
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Levels, Linear, Piecewise, Proximity

COLUMNS = ("is_truck", "lane_index", "speed")
"""What a population's drivers are distinguished by: class, lane and speed."""

PIECE = 10.0
"""Snippets whose mean and spread are explained, the paper's. [s]"""

STRAIGHT_QUANTILES = (0.05, 0.95)
"""Quantiles of the speed within which its effect is a straight line; beyond, it stays as it is there. [-]"""

LEAST_DRIVES = 30
"""Fewer are no population: whose lane it was, and who he is, can't be separated. As many are to have had a neighbour:
errors clustered by drive are too small where few have one (where nothing acts, 90, 8 and 7 % of the effects are beyond
two of their errors if 1, 5 and 20 of 60 drives do). [-]"""

RIGHTMOST = 0.0
"""Lane index with a level of its own; overtaking lanes share another."""

DIGITS = 6
"""Significant digits kept of effects: what differs beyond is the processor's rounding. [-]"""


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Snippets of all runs: one observation each, shape (n,)."""

    mean: FloatArray
    """Of the offset. [m]"""
    spread: FloatArray
    """Logarithms of the standard deviations of the slow part and, `fine`, of the fast one. [-]"""
    fine: FloatArray
    quantities: FloatArray
    """Mean of each quantity, shape (n, k)."""
    drive: IntArray


def fit_place(runs: Sequence[Run], *, neighbours: bool | None = None) -> tuple[ColumnEffect, ...]:
    """Effects of class, lane, speed and neighbours; none of too few drives, or where none of these is known.

    Drivers' own levels are a random effect, and errors are robust against whatever else the snippets of one drive
    share [1]_. The slopes of all columns are shrunk together, by the share of their size that chance would not make
    (`_shrunk`): dropping the uncertain ones predicts other vehicles worse. Nothing is left where chance makes all.

    With `neighbours` also of the distances to vehicles in the neighbouring lanes, on the level. None: of each side on
    which `LEAST_DRIVES` drives had somebody; with fewer, chance would pass for an effect. True raises
    `NotEnoughDataError` where there are too few drives, or too few that had any.

    References
    ----------
    .. [1] B. H. Baltagi, "Econometric Analysis of Panel Data", sections 2.3 and 2.4.2: random effects by a
       quasi-demeaned regression; errors clustered by individual.
    .. [2] B. Efron, C. Morris, "Stein's estimation rule and its competitors - an empirical Bayes approach", J. American
       Statistical Association 68 (1973).
    """
    shapes, drives = _shapes(runs), len({run.drive for run in runs})
    beside = [] if neighbours is False else neighbour_shapes(runs, LEAST_DRIVES)
    if neighbours and not beside:
        raise NotEnoughDataError(_why_no_neighbours(runs, drives))
    if drives < LEAST_DRIVES or not (shapes or beside):
        return ()
    pieces = _pieces(runs, [*shapes, *beside])
    effects = _effects([*shapes, *beside], Acts.LOCATION, pieces.mean, pieces)
    for acts, response in ((Acts.SPREAD, pieces.spread), (Acts.FINE, pieces.fine)):
        effects += _effects(shapes, acts, response, pieces)
    return tuple(effects)


def _why_no_neighbours(runs: Sequence[Run], drives: int) -> str:
    if drives < LEAST_DRIVES:
        return f"what neighbours do takes {LEAST_DRIVES} drives at least, these are {drives}"
    if not any(np.isfinite(run.context.get(name, np.nan)).any() for run in runs for name in NEIGHBOURS):
        return f"no drive has a neighbour: columns {' and '.join(NEIGHBOURS)} are missing or empty"
    return (
        f"what neighbours do takes {LEAST_DRIVES} drives that have one within {SCALE:g} m on the same side, "
        f"these are {most_beside(runs)}"
    )


def without_place(runs: Sequence[Run], effects: Sequence[ColumnEffect]) -> list[Run]:
    """Runs as they would be with every column at its reference."""
    return [_at_reference(run, effects) for run in runs] if effects else list(runs)


def _at_reference(run: Run, effects: Sequence[ColumnEffect]) -> Run:
    strength = {acts: np.zeros(len(run)) for acts in (Acts.LOCATION, Acts.SPREAD, Acts.FINE)}
    for effect in effects:
        acting = effect.strength(STEP, run.context)
        if acting is not None:
            strength[effect.acts] += acting
    moved = run.offset - strength[Acts.LOCATION]
    level = float(moved.mean())
    slow, fast = split_bands(moved - level, STEP)
    return replace(run, offset=level + slow * np.exp(-strength[Acts.SPREAD]) + fast * np.exp(-strength[Acts.FINE]))


def _shapes(runs: Sequence[Run]) -> list[ColumnEffect]:
    """Effects without coefficients, of columns that all runs have and that vary."""
    shared = set.intersection(*(set(run.context) for run in runs)) if runs else set()
    columns = {name: np.concatenate([run.context[name] for run in runs]) for name in COLUMNS if name in shared}
    varying = {name for name, values in columns.items() if np.isfinite(values).all() and np.ptp(values) > 0.0}
    kept: list[ColumnEffect] = []
    if "is_truck" in varying:
        kept.append(Linear(acts=Acts.LOCATION, column="is_truck"))
    if "lane_index" in varying:
        kept.append(Levels(acts=Acts.LOCATION, column="lane_index", levels=(RIGHTMOST,)))
    if "speed" in varying:
        low, high = all_significant(np.quantile(columns["speed"], STRAIGHT_QUANTILES), 3)
        if high > low:
            kept.append(Piecewise(acts=Acts.LOCATION, column="speed", knots=(low, high)))
    return kept


def _quantity(effect: ColumnEffect, run: Run) -> FloatArray:
    """The one number that an effect goes by, shape (n,): of a speed, its place between the knots."""
    if isinstance(effect, Proximity):  # a run that has no such column had nobody there
        return effect.response(STEP, run.context)[:, 0] if effect.column in run.context else np.zeros(len(run))
    values = effect.quantity(run.context)
    return values[:, 1] - values[:, 2] if isinstance(effect, Piecewise) else values[:, 0]


def _pieces(runs: Sequence[Run], shapes: Sequence[ColumnEffect]) -> _Pieces:
    size = round(PIECE / STEP)
    number = {name: k for k, name in enumerate(dict.fromkeys(run.drive for run in runs))}
    mean, spread, fine, rows, drive = [], [], [], [], []
    for run in runs:
        slow, fast = split_bands(run.offset, STEP)
        quantities = np.stack([_quantity(shape, run) for shape in shapes], axis=1)
        for first in range(0, len(run) - size + 1, size):
            piece = slice(first, first + size)
            mean.append(run.offset[piece].mean())
            spread.append(np.log(slow[piece].std() + 1e-6))
            fine.append(np.log(fast[piece].std() + 1e-6))
            rows.append(quantities[piece].mean(axis=0))
            drive.append(number[run.drive])
    quantities = np.array(rows).reshape(len(rows), len(shapes))
    return _Pieces(np.array(mean), np.array(spread), np.array(fine), quantities, np.array(drive, dtype=np.int64))


def _effects(shapes: Sequence[ColumnEffect], acts: Acts, response: FloatArray, pieces: _Pieces) -> list[ColumnEffect]:
    """One of each column, which are the first of the pieces', or none."""
    if not shapes:
        return []
    quantities = pieces.quantities[:, : len(shapes)]
    slopes, covariance = _regressed(response, quantities, pieces.drive)
    errors, reference = np.sqrt(np.maximum(np.diag(covariance), 1e-30)), quantities.mean(axis=0)
    shrunk = _shrunk(slopes, covariance)
    numbers = zip(shrunk.tolist(), errors.tolist(), reference.tolist(), strict=True)
    return [_effect(shape, acts, *own) for shape, own in zip(shapes, numbers, strict=True)] if shrunk.any() else []


def _shrunk(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    """Slopes, shape (k,), times the share of their size that is not chance's, at least 0.

    Chance alone gives a squared size, in units of the covariance, of k on average.
    """
    size = float(slopes @ np.linalg.pinv(covariance) @ slopes)
    return np.asarray(slopes * max(0.0, 1.0 - len(slopes) / max(size, 1e-30)))


def _regressed(observed: FloatArray, quantities: FloatArray, drive: IntArray) -> tuple[FloatArray, FloatArray]:
    """Slopes, shape (k,), and their covariance, shape (k, k)."""
    design = np.column_stack([np.ones(len(observed)), quantities])
    counts = np.bincount(drive).astype(np.float64)
    rest = observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0]
    means = np.bincount(drive, rest) / counts
    within = float(((rest - means[drive]) ** 2).sum() / max(len(rest) - len(counts), 1))
    between = max(float(rest.var()) - within, 0.0)
    theta = (1.0 - np.sqrt(within / (within + counts * between + 1e-30)))[drive]
    columns = [column - theta * (np.bincount(drive, column) / counts)[drive] for column in (*design.T, observed)]
    x, y = np.column_stack(columns[:-1]), columns[-1]
    slopes, covariance = clustered_least_squares(x, y, drive)
    return slopes[1:], covariance[1:, 1:]


def _effect(shape: ColumnEffect, acts: Acts, slope: float, error: float, reference: float) -> ColumnEffect:
    slope, error, reference = all_significant((slope, error, reference), DIGITS)
    if isinstance(shape, Piecewise):  # flat, a straight line between the knots, flat; the reference is one place on it
        coefficients, errors, middle = (0.0, slope, -slope), (0.0, error, error), (0.0, reference, 0.0)
        return with_fields(shape, acts=acts, coefficients=coefficients, errors=errors, reference=middle)
    fades = isinstance(shape, Proximity)
    return with_fields(
        shape, acts=acts, coefficients=(slope,), errors=(error,), reference=(0.0 if fades else reference,)
    )
