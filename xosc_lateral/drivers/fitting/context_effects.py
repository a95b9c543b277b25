"""What class, lane, speed and neighbours do to level, spread and fine movement, fitted before the rest.

Trucks, cars and lanes of one recording differ. What of it is beyond chance becomes effects of the profile, so that one
profile gives each its own, wherever class, lane and speed are known. Of a single driver only the response to vehicles
beside him can be told from himself. It is measured where enough driving beside somebody was seen to say how far he
moves, also when that is not at all; what is unknown is a population's to lend.

The effect of a neighbour fades exponentially with the free space lengthwise, and is none where there is nobody. Its
form was found in DLR Highway Traffic v1.1.0 (laboratory/neighbour_response.py): of those within 0.5 % of the variance
of the best, one that is not too quick, and without a corner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from msgspec.structs import replace as with_fields

from xosc_lateral.base.arrays import FloatArray, IntArray, all_significant
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.fitting.regression import autoregressive_least_squares, random_effects_least_squares
from xosc_lateral.drivers.model.core.autoregressive.parameters import split_bands
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Levels, Linear, Piecewise, Proximity
from xosc_lateral.drivers.model.profile import SIDES, SIGNIFICANT_ERRORS, Basis, Beside

COLUMNS = ("is_truck", "lane_index", "speed")
"""What a population's drivers are distinguished by: class, lane and speed."""

NEIGHBOURS = ("left_distance", "right_distance")
"""Free space lengthwise to the nearest vehicle in the lane to the left and to the right [m]; NaN or infinite: none."""

SNIPPET = 10.0
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

FADING_DISTANCE = 40.0
"""Free space over which the effect of a neighbour fades to 37 %. [m]"""

RESPONSE: dict[str, Any] = {"lag_s": -1.0, "response_s": 1.0, "response_order": 2}
"""Delay, and two first-order lags: drivers see neighbours coming, and nobody moves at once. After a single lag of 2 s
somebody who comes into the lane would be a corner in the path, which no car can drive."""


def fit_context_effects(runs: Sequence[Run], *, neighbours: bool | None = None) -> tuple[ColumnEffect, ...]:
    """Effects of class, lane, speed and neighbours; none of too few drives, or where none of these is known.

    Drivers' own levels are a random effect, and errors are robust against whatever else the snippets of one drive
    share. The slopes of all columns are shrunk together, by the share of their size that chance would not make
    (`_shrunk`): dropping the uncertain ones predicts other vehicles worse. Nothing is left where chance makes all.

    With `neighbours` also of the distances to vehicles in the neighbouring lanes, on the level. None: of each side on
    which `LEAST_DRIVES` drives had somebody; with fewer, chance would pass for an effect. True raises
    `NotEnoughDataError` where there are too few drives, or too few that had any.
    """
    shapes, drives = _shapes(runs), len({run.drive for run in runs})
    with_somebody = {
        name: {run.drive for run in runs if (np.abs(run.context.get(name, np.inf)) <= FADING_DISTANCE).any()}
        for name in NEIGHBOURS
    }
    beside: list[ColumnEffect] = []
    if neighbours is not False:
        beside = [response_to(name) for name, near in with_somebody.items() if len(near) >= LEAST_DRIVES]
    if neighbours and not beside:
        why = f"what neighbours do takes {LEAST_DRIVES} drives at least, these are {drives}"
        if drives >= LEAST_DRIVES:
            why = (
                f"what neighbours do takes {LEAST_DRIVES} drives that have one within {FADING_DISTANCE:g} m on the "
                f"same side, these are {max(map(len, with_somebody.values()))}"
            )
            if not any(np.isfinite(run.context.get(name, np.nan)).any() for run in runs for name in NEIGHBOURS):
                why = f"no drive has a neighbour: columns {' and '.join(NEIGHBOURS)} are missing or empty"
        raise NotEnoughDataError(why)
    if drives < LEAST_DRIVES or not (shapes or beside):
        return ()
    levels, quantities, drive = _snippets(runs, [*shapes, *beside])
    effects = []
    for acts, level, acting in zip(
        (Acts.LOCATION, Acts.SPREAD, Acts.FINE), levels, ([*shapes, *beside], shapes, shapes), strict=True
    ):
        if acting:
            effects += _effects(acting, acts, level, quantities[:, : len(acting)], drive)
    return tuple(effects)


def without_effects(runs: Sequence[Run], effects: Sequence[ColumnEffect]) -> list[Run]:
    """Runs as they would be with every column at its reference."""
    if not effects:
        return list(runs)
    freed = []
    for run in runs:
        strength = {acts: np.zeros(len(run)) for acts in (Acts.LOCATION, Acts.SPREAD, Acts.FINE)}
        for effect in effects:
            acting = effect.strength(STEP, run.context)
            if acting is not None:
                strength[effect.acts] += acting
        moved = run.offset - strength[Acts.LOCATION]
        level = float(moved.mean())
        slow, fast = split_bands(moved - level, STEP)
        offset = level + slow * np.exp(-strength[Acts.SPREAD]) + fast * np.exp(-strength[Acts.FINE])
        freed.append(replace(run, offset=offset))
    return freed


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
    if "speed" in varying and _lasts([run.context["speed"] for run in runs]):
        low, high = all_significant(np.quantile(columns["speed"], STRAIGHT_QUANTILES), 3)
        if high > low:
            kept.append(Piecewise(acts=Acts.LOCATION, column="speed", knots=(low, high)))
    return kept


def _lasts(columns: Sequence[FloatArray]) -> bool:
    """Whether a column differs more between snippets than within them. If not, it is the jitter of a derived speed, of
    which snippets' means say nothing, and which as an effect would make every row jitter."""
    size = round(SNIPPET / STEP)
    parts = [column[: len(column) // size * size].reshape(-1, size) for column in columns]
    snippets = np.concatenate(parts) if parts else np.empty((0, size))
    return len(snippets) > 0 and bool(snippets.mean(axis=1).var() > snippets.var(axis=1).mean())


def _snippets(runs: Sequence[Run], shapes: Sequence[ColumnEffect]) -> tuple[FloatArray, FloatArray, IntArray]:
    """Snippets of all runs: mean offset [m], log deviation of its slow and of its fast part, shape (3, n); the mean of
    what each effect goes by, shape (n, k); number of the drive, shape (n,)."""
    size = round(SNIPPET / STEP)
    number = {name: k for k, name in enumerate(dict.fromkeys(run.drive for run in runs))}
    levels, rows, drive = [], [], []
    for run in runs:
        quantities = np.stack([_quantity(shape, run) for shape in shapes], axis=1)
        slow, fast = split_bands(run.offset, STEP)
        for first in range(0, len(run) - size + 1, size):
            part = slice(first, first + size)
            deviations = np.log(slow[part].std() + 1e-6), np.log(fast[part].std() + 1e-6)
            levels.append((run.offset[part].mean(), *deviations))
            rows.append(quantities[part].mean(axis=0))
            drive.append(number[run.drive])
    quantities = np.array(rows).reshape(len(rows), len(shapes))
    return np.array(levels).reshape(-1, 3).T.copy(), quantities, np.array(drive, dtype=np.int64)


def _quantity(effect: ColumnEffect, run: Run) -> FloatArray:
    """The one number that an effect goes by, shape (n,): of a speed, its place between the knots."""
    if isinstance(effect, Proximity):
        return _nearness(run, effect)
    values = effect.quantity(run.context)
    return values[:, 1] - values[:, 2] if isinstance(effect, Piecewise) else values[:, 0]


def _effects(
    shapes: Sequence[ColumnEffect], acts: Acts, observed: FloatArray, quantities: FloatArray, drive: IntArray
) -> list[ColumnEffect]:
    """One of each column, or none."""
    slopes, covariance = random_effects_least_squares(quantities, observed, drive)
    errors, references = np.sqrt(np.maximum(np.diag(covariance), 1e-30)), quantities.mean(axis=0)
    shrunk = _shrunk(slopes, covariance)
    if not shrunk.any():
        return []
    effects = []
    for shape, *numbers in zip(shapes, shrunk.tolist(), errors.tolist(), references.tolist(), strict=True):
        slope, error, reference = all_significant(numbers, DIGITS)
        coefficients: tuple[float, ...] = (slope,)
        deviations: tuple[float, ...] = (error,)
        middle: tuple[float, ...] = (0.0 if isinstance(shape, Proximity) else reference,)
        if isinstance(shape, Piecewise):  # flat, a straight line between the knots, flat; the reference is on it
            coefficients, deviations, middle = (0.0, slope, -slope), (0.0, error, error), (0.0, reference, 0.0)
        effects.append(with_fields(shape, acts=acts, coefficients=coefficients, errors=deviations, reference=middle))
    return effects


def _shrunk(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    """Slopes, shape (k,), times the share of their size that is not chance's, at least 0.

    Chance alone gives a squared size, in units of the covariance, of k on average (B. Efron, C. Morris, "Stein's
    estimation rule and its competitors - an empirical Bayes approach", J. American Statistical Association 68, 1973).
    """
    size = float(slopes @ np.linalg.pinv(covariance) @ slopes)
    return np.asarray(slopes * max(0.0, 1.0 - len(slopes) / max(size, 1e-30)))


# ---- a single driver beside vehicles ----
MEASURED_ERROR = 0.05
"""A shift is measured when its standard error is at most this: what separates drivers who respond (0.2 m) from those
who don't by four errors. [m]"""

LEAST_SECONDS = 60.0
"""Driving beside somebody, and away from anybody, below which no error is trusted. [s]"""

AMONG_DRIVERS = {"left": (-0.0924, 0.1), "right": (0.2550, 0.1)}
"""Shift alongside, positive left: mean (of the shipped `motorway`: DLR Highway Traffic v1.1.0), and how far single
drivers are from it, which no recording that we have shows: assumed, so that errors of 0.05 m weigh a fifth. [m]"""

CLUSTERED_FACTOR = 1.2
"""By which errors clustered by `BLOCK` are too small, found with simulated drivers whose memory is 10 s (60 seeds: 1.15
to 1.2 with 12 to 30 minutes). [-]"""

PIECE, BLOCK = 4.0, 60.0
"""Driving whose mean is one observation, and that is one cluster of the errors: several memories of a driver. [s]"""


def measure_beside(runs: Sequence[Run]) -> dict[str, Beside]:
    """What runs of one driver say of his shift beside somebody, by side; absent where they are too few to say.

    Means over `PIECE` within each drive, speed and lane taken out, errors clustered by `BLOCK`.
    """
    shapes = {side: shape for side in SIDES if (shape := _shape(runs, side)) is not None}
    if not shapes:
        return {}
    near = {side: [_nearness(run, shape) for run in runs] for side, shape in shapes.items()}
    slopes, errors = _shifts_beside(runs, near)
    measured = {}
    for side, slope, error in zip(shapes, slopes, errors, strict=True):
        beside = np.concatenate(near[side]) > np.exp(-1.0)
        seconds, away = STEP * beside.sum(), STEP * (~beside).sum()
        if error <= MEASURED_ERROR and min(seconds, away) >= LEAST_SECONDS:
            figures = round(float(seconds), 1), round(float(slope), 4), round(float(error), 4)
            measured[side] = Beside(Basis.MEASURED, *figures)
    return measured


def beside_effects(runs: Sequence[Run], known: Mapping[str, Beside]) -> tuple[ColumnEffect, ...]:
    """Effects of measured shifts that are beyond chance, pooled with the population's as their errors ask."""
    effects: list[ColumnEffect] = []
    for side, beside in known.items():
        shape = _shape(runs, side)
        if (
            shape is None
            or beside.basis is not Basis.MEASURED
            or abs(beside.shift) <= SIGNIFICANT_ERRORS * beside.error
        ):
            continue
        mean, spread = AMONG_DRIVERS[side]
        weight = spread**2 / (spread**2 + beside.error**2)
        size, error = weight * beside.shift + (1.0 - weight) * mean, np.sqrt(weight) * beside.error
        numbers = {"coefficients": (round(size, 4),), "errors": (round(float(error), 4),), "reference": (0.0,)}
        effects.append(with_fields(shape, **numbers))
    return tuple(effects)


def _shape(runs: Sequence[Run], side: str) -> ColumnEffect | None:
    """By the distance, else by the flag for trucks or cars: of which there is somebody, without a coefficient."""
    for column in (f"{side}_distance", f"truck_{side}", f"car_{side}"):
        shape = response_to(column)
        if any(column in run.context and (_nearness(run, shape) > np.exp(-1.0)).any() for run in runs):
            return shape
    return None


def response_to(column: str) -> ColumnEffect:
    """To a neighbour's distance, or to a flag that there is one; without coefficients."""
    if column.endswith("distance"):
        return Proximity(acts=Acts.LOCATION, column=column, scale=FADING_DISTANCE, **RESPONSE)
    return Linear(acts=Acts.LOCATION, column=column, **RESPONSE)


def _nearness(run: Run, shape: ColumnEffect) -> FloatArray:
    """From 0 (nobody) to 1 (alongside), shape (n,); a run without the column had nobody there."""
    if any(column not in run.context for column in shape.columns):
        return np.zeros(len(run))
    return np.nan_to_num(shape.response(STEP, run.context)[:, 0])


def _shifts_beside(runs: Sequence[Run], near: Mapping[str, Sequence[FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """Slopes of the offset by each side's nearness and their errors, shape (sides,) each. [m]"""
    size, per_block, sides = round(PIECE / STEP), round(BLOCK / PIECE), len(near)
    rows, drive, block = [], [], []
    numbers = {name: k for k, name in enumerate(dict.fromkeys(run.drive for run in runs))}
    for k, run in enumerate(runs):
        others = [np.nan_to_num(run.context.get(name, np.zeros(len(run)))) for name in ("speed", "lane_index")]
        columns = [run.offset, *(values[k] for values in near.values()), *others]
        for j in range(len(run) // size):
            rows.append([float(column[j * size : (j + 1) * size].mean()) for column in columns])
            drive.append(numbers[run.drive])
            block.append((k, j // per_block))
    if len(rows) < len(numbers) + sides + 2:
        return np.zeros(sides), np.full(sides, np.inf)
    slopes, errors = autoregressive_least_squares(np.array(rows), np.array(drive), np.array(block))
    return slopes[:sides], CLUSTERED_FACTOR * errors[:sides]
