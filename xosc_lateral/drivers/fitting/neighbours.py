"""How a driver responds to vehicles beside him: measured, declared, or unknown.

Measured means that enough driving beside somebody was seen to say how far he moves, also when that is not at all. What
is unknown is a population's to lend.

The effect fades exponentially with the free space lengthwise, and is none where there is nobody. Its form was found in
DLR Highway Traffic v1.1.0 (laboratory/neighbour_response.py): of those within 0.5 % of the variance of the best, one
that is not too quick, and without a corner.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.fitting.regression import clustered_least_squares
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Linear, Proximity
from xosc_lateral.drivers.model.profile import COLUMNS, SIDES, Basis, Beside, DriverProfile

NEIGHBOURS = ("left_distance", "right_distance")
"""Free space lengthwise to the nearest vehicle in the lane to the left and to the right [m]; NaN or infinite: none."""

SCALE = 40.0
"""Free space over which the effect fades to 37 %. [m]"""

LAG, RESPONSE, ORDER = -1.0, 1.0, 2
"""Delay, and two first-order lags: drivers see neighbours coming, and nobody moves at once. After a single lag of 2 s
somebody who comes into the lane would be a corner in the path, which no car can drive. [s], [s], [-]"""

MEASURED_ERROR = 0.05
"""A shift is measured when its standard error is at most this: what separates drivers who answer (0.2 m) from those who
don't by four errors. [m]"""

LEAST_SECONDS = 60.0
"""Driving beside somebody, and away from anybody, below which no error is trusted. [s]"""

AMONG_DRIVERS = {"left": (-0.0924, 0.1), "right": (0.2550, 0.1)}
"""Shift alongside, positive left: mean (of the shipped `motorway`: DLR Highway Traffic v1.1.0), and how far single
drivers are from it, which no recording that we have shows: assumed, so that errors of 0.05 m weigh a fifth. [m]"""

SIGNIFICANT = 2.6
"""Standard errors from which a shift becomes an effect: one of a hundred by chance. [-]"""

CLUSTERED = 1.2
"""By which errors clustered by `BLOCK` are too small, found with simulated drivers whose memory is 10 s (60 seeds: 1.15
to 1.2 with 12 to 30 minutes). [-]"""

MAXIMUM_PIECE_CORRELATION = 0.95
"""Most that one piece may say of the next: beyond, next to nothing of a level is left after differencing. [-]"""

PIECE, BLOCK = 4.0, 60.0
"""Driving whose mean is one observation, and that is one cluster of the errors: several memories of a driver. [s]"""


def basis_of(profile: DriverProfile, side: str) -> Basis:
    """Where a profile's answer to neighbours on a side is known from.

    A shift that was measured and that no effect of the profile makes is as good as unknown; one that its effects make
    and of which nothing else is said was measured by who found them.
    """
    answers = any(column in COLUMNS[side] for column in profile.columns)
    known = profile.beside.get(side)
    if known is None or known.basis is Basis.UNKNOWN:
        return Basis.MEASURED if answers else Basis.UNKNOWN
    if known.basis is Basis.MEASURED and not answers and abs(known.shift) > SIGNIFICANT * known.error:
        return Basis.UNKNOWN
    return known.basis


def borrows(profile: DriverProfile, side: str) -> bool:
    """Whether a conversion borrows the population's answer on a side unless asked otherwise."""
    return basis_of(profile, side) is Basis.UNKNOWN


def measure_beside(runs: Sequence[Run]) -> dict[str, Beside]:
    """What runs of one driver say of his shift beside somebody, by side; absent where they are too few to say.

    Means over `PIECE` within each drive, speed and lane taken out, errors clustered by `BLOCK`.
    """
    shapes = {side: shape for side in SIDES if (shape := _shape(runs, side)) is not None}
    if not shapes:
        return {}
    near = {side: [_rows_beside(run, shape) for run in runs] for side, shape in shapes.items()}
    slopes, errors = _within_drives(runs, near)
    measured = {}
    for side, slope, error in zip(shapes, slopes, errors, strict=True):
        beside = np.concatenate(near[side]) > np.exp(-1.0)
        seconds, away = STEP * beside.sum(), STEP * (~beside).sum()
        sure = error <= MEASURED_ERROR and min(seconds, away) >= LEAST_SECONDS
        if sure:
            measured[side] = Beside(
                Basis.MEASURED, round(float(seconds), 1), round(float(slope), 4), round(float(error), 4)
            )
    return measured


def answer_effects(runs: Sequence[Run], known: Mapping[str, Beside]) -> list[ColumnEffect]:
    """Effects of measured shifts that are beyond chance, pooled with the population's as their errors ask."""
    from msgspec.structs import replace

    effects: list[ColumnEffect] = []
    for side, beside in known.items():
        shape = _shape(runs, side)
        if shape is None or beside.basis is not Basis.MEASURED or abs(beside.shift) <= SIGNIFICANT * beside.error:
            continue
        mean, spread = AMONG_DRIVERS[side]
        weight = spread**2 / (spread**2 + beside.error**2)
        size, error = weight * beside.shift + (1.0 - weight) * mean, np.sqrt(weight) * beside.error
        numbers = {"coefficients": (round(size, 4),), "errors": (round(float(error), 4),), "reference": (0.0,)}
        effects.append(replace(shape, **numbers))
    return effects


def _shape(runs: Sequence[Run], side: str) -> ColumnEffect | None:
    """By the distance, else by the flag for trucks or cars: of which there is somebody, without a coefficient."""
    for column in (f"{side}_distance", f"truck_{side}", f"car_{side}"):
        shape = _response_to(column)
        if any(column in run.context and (_rows_beside(run, shape) > np.exp(-1.0)).any() for run in runs):
            return shape
    return None


def _response_to(column: str) -> ColumnEffect:
    """To a neighbour's distance, or to a flag that there is one; without coefficients."""
    response: dict[str, Any] = {"lag_s": LAG, "response_s": RESPONSE, "response_order": ORDER}
    if column.endswith("distance"):
        return Proximity(acts=Acts.LOCATION, column=column, scale=SCALE, **response)
    return Linear(acts=Acts.LOCATION, column=column, **response)


def _rows_beside(run: Run, shape: ColumnEffect) -> FloatArray:
    """From 0 (nobody) to 1 (alongside), shape (n,); a run without the column had nobody there."""
    if any(column not in run.context for column in shape.columns):
        return np.zeros(len(run))
    return np.nan_to_num(shape.response(STEP, run.context)[:, 0])


def _within_drives(runs: Sequence[Run], near: Mapping[str, Sequence[FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """Slopes of the offset by each side's nearness and their errors, shape (sides,) each. [m]

    Generalised least squares of an autoregression from piece to piece [1]_, errors clustered.

    References
    ----------
    .. [1] D. Cochrane, G. H. Orcutt, "Application of least squares regression to relationships containing
       auto-correlated error terms", J. American Statistical Association 44, 1949.
    """
    size, per_block = round(PIECE / STEP), round(BLOCK / PIECE)
    rows, drive, block = [], [], []
    numbers = {name: k for k, name in enumerate(dict.fromkeys(run.drive for run in runs))}
    for k, run in enumerate(runs):
        columns = [run.offset, *(values[k] for values in near.values()), *_other_causes(run)]
        for j in range(len(run) // size):
            rows.append([float(column[j * size : (j + 1) * size].mean()) for column in columns])
            drive.append(numbers[run.drive])
            block.append((k, j // per_block))
    sides = len(near)
    if len(rows) < len(numbers) + sides + 2:
        return np.zeros(sides), np.full(sides, np.inf)
    table, groups, number = np.array(rows), np.array(drive), np.array(block)
    follows = np.flatnonzero(number[1:, 0] == number[:-1, 0]) + 1  # the piece before is of the same run
    plain = _centred(table, groups)
    rest = plain[:, 0] - plain[:, 1:] @ (np.linalg.pinv(plain[:, 1:]) @ plain[:, 0])
    power = float(rest[follows - 1] @ rest[follows - 1])
    keep = min(max(float(rest[follows] @ rest[follows - 1]) / max(power, 1e-12), 0.0), MAXIMUM_PIECE_CORRELATION)
    # a driver's slow drift is separated from what he does beside somebody
    table, groups, number = table[follows] - keep * table[follows - 1], groups[follows], number[follows]
    table = _centred(table, groups)
    observed, design = table[:, 0], table[:, 1:]
    distinct, cluster = np.unique(number, axis=0, return_inverse=True)
    slopes, covariance = clustered_least_squares(design, observed, cluster.ravel())
    blocks, free = len(distinct), max(len(observed) - len(numbers) - design.shape[1], 1)
    covariance *= blocks / max(blocks - 1, 1) * len(observed) / free
    known = np.diag(design.T @ design)[:sides] > 1e-6
    errors = np.where(known & (blocks > 2), CLUSTERED * np.sqrt(np.maximum(np.diag(covariance)[:sides], 0.0)), np.inf)
    return np.where(known, slopes[:sides], 0.0), errors


def _centred(table: FloatArray, groups: IntArray) -> FloatArray:
    """Columns without their mean within each group."""
    counts = np.maximum(np.bincount(groups), 1)
    return np.stack([column - (np.bincount(groups, column) / counts)[groups] for column in table.T], axis=1)


def _other_causes(run: Run) -> list[FloatArray]:
    """What else moves a driver and goes along with having somebody beside: speed and lane; 0 where unknown."""
    return [np.nan_to_num(run.context.get(name, np.zeros(len(run)))) for name in ("speed", "lane_index")]


UNMEASURED_RESPONSES = {
    Basis.POPULATION: "moves as the drivers of its recording do",
    Basis.DECLARED: "moves as its effects state",
    Basis.MEASURED: "moves as its effects state",
    Basis.UNKNOWN: "not known, does not move",
}
"""How a driver responds to vehicles beside him, by what that rests on, where the profile holds no figure."""


def responses_in_words(profile: DriverProfile, borrowed: Collection[str] = ()) -> str:
    """How a driver responds to vehicles on either side, in a line; on `borrowed` sides as the population does."""
    words = {side: _response_in_words(profile, side, side in borrowed) for side in SIDES}
    if len(set(words.values())) == 1:
        return f"beside vehicles on either side: {words[SIDES[0]]}"
    return "; ".join(f"beside vehicles on the {side}: {text}" for side, text in words.items())


def _response_in_words(profile: DriverProfile, side: str, is_borrowed: bool) -> str:
    if is_borrowed:
        return "not known, moves as the population does"
    basis, known = basis_of(profile, side), profile.beside.get(side)
    if known is None or not known.seconds:
        return UNMEASURED_RESPONSES[basis]
    way = "left" if known.shift > 0 else "right"
    return f"moves {abs(known.shift):.2f} +- {known.error:.2f} m to the {way} ({basis}, {known.seconds:.0f} s)"


def neighbour_shapes(runs: Sequence[Run], least: int) -> list[ColumnEffect]:
    """Effects without coefficients, of each side on which so many drives have somebody within `SCALE`."""
    return [_response_to(name) for name in NEIGHBOURS if len(_drives_beside(runs, name)) >= least]


def most_beside(runs: Sequence[Run]) -> int:
    """How many drives have somebody within `SCALE`, on the side on which more do."""
    return max(len(_drives_beside(runs, name)) for name in NEIGHBOURS)


def _drives_beside(runs: Sequence[Run], column: str) -> set[str]:
    return {run.drive for run in runs if column in run.context and (np.abs(run.context[column]) <= SCALE).any()}
