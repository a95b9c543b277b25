"""Where transitions between lane offsets lead to, once it is known when they begin and end.

The offset at a time is linear in the targets, and so is the bound on a transition's turn. So the targets with the
smallest errors are the answer to a linear programme. To lead to the sampled offset itself is not the best: on a drift,
and where an offset turns back, a transition errs on one side.

References
----------
.. [1] ASAM OpenSCENARIO XML 1.3, DynamicsShape: a transition of the shape "sinusoidal" is half a cosine.
.. [2] Q. Huangfu, J. A. J. Hall, "Parallelizing the dual revised simplex method", Mathematical Programming
       Computation 10, 2018: what solves the programme.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.sparse import coo_array

FRAME = 0.01
"""A lane offset action stands still in the first frame of the reference player. [s]"""


class Ramp(Struct, frozen=True):
    """One lane offset action: from `origin` to `target` between two times, along half a cosine. [s], [m]"""

    start: float
    end: float
    origin: float
    target: float


def acceleration(change: ArrayLike, duration: ArrayLike) -> FloatArray:
    """Largest lateral acceleration of a transition, at its beginning and end. [m/s2]"""
    return np.asarray(0.5 * np.pi**2 * np.abs(change) / np.square(duration))


def largest_change(duration: ArrayLike, limit: ArrayLike, slowing: ArrayLike, speed: ArrayLike) -> FloatArray:
    """As far as a transition may lead in some time. [m]

    `limit` is on what turns the car [m/s2], `speed` on the lateral speed [m/s]; `slowing` is how fast the car's speed
    changes, as a share of itself [1/s]: a car that brakes turns by its lateral speed.
    """
    share = np.asarray(duration) * np.asarray(slowing) / np.pi
    by_turn = np.asarray(limit) / (acceleration(1.0, duration) * np.sqrt(1.0 + share**2))
    return np.asarray(np.minimum(by_turn, 2.0 / np.pi * np.asarray(duration) * np.asarray(speed)))


def slowing(time: FloatArray, limit: FloatArray) -> FloatArray:
    """How fast the speed changes, as a share of itself, from a limit in proportion to it. [1/s]"""
    return np.asarray(np.abs(np.gradient(limit, time)) / limit)


def fitted(
    ramps: Sequence[Ramp],
    time: FloatArray,
    offset: FloatArray,
    limit: FloatArray,
    speed: FloatArray,
    *,
    settles: bool,
    starts: bool,
) -> list[Ramp]:
    """The same transitions with the targets whose errors are smallest: the largest first, and then those of each.

    Parameters
    ----------
    ramps : sequence of Ramp
        In order, each from where the one before leads to.
    time, offset : array, shape (n,)
        To be followed. [s], [m]
    limit : array, shape (n,)
        Of the lateral acceleration, with which the largest change of each transition is found. [m/s2]
    speed : array, shape (n,)
        The same of the lateral speed. [m/s]
    settles : bool
        The first transition only leads there: its own errors don't count.
    starts : bool
        It may start anywhere.
    """
    from scipy.optimize import linprog
    from scipy.sparse import block_array, coo_array, eye_array

    if not ramps:
        return []
    count = len(ramps)
    start, end = (np.array([getattr(ramp, name) for ramp in ramps]) for name in ("start", "end"))
    counted = time >= (end[0] if settles else start[0])
    when, wanted = time[counted], offset[counted]
    which = np.searchsorted(start, when, side="right") - 1
    share = 0.5 - 0.5 * np.cos(np.pi * np.clip((when - start[which] - FRAME) / (end - start)[which], 0.0, 1.0))
    # Unknown are where the first one starts, the targets, the largest error of each transition and that of them all.
    rows, each = np.arange(len(when)), np.arange(count)
    place = _sparse(rows, (which, 1.0 - share), (which + 1, share), shape=(len(when), count + 1))
    error = _sparse(rows, (which, -np.ones(len(when))), shape=(len(when), count))
    change = _sparse(each, (each, -np.ones(count)), (each + 1, np.ones(count)), shape=(count, count + 1))
    blocks: list[list[Any]] = [
        [place, error, None],
        [-place, error, None],
        [change, None, None],
        [-change, None, None],
        [None, eye_array(count), coo_array(-np.ones((count, 1)))],
    ]
    parts = [(time >= a - 1e-9) & (time <= b + 1e-9) for a, b in zip(start, end, strict=True)]
    change_of_speed = slowing(time, limit)
    bounds = np.array([(limit[part].min(), change_of_speed[part].max(), speed[part].min()) for part in parts]).T
    most = largest_change(end - start, *bounds)
    lower, upper = np.repeat([-np.inf, 0.0], count + 1), np.full(2 * count + 2, np.inf)
    if not starts:
        lower[0] = upper[0] = ramps[0].origin
    matrix: Any = block_array(blocks, format="csr")
    limits: Any = np.column_stack((lower, upper))
    found = linprog(
        np.concatenate((np.zeros(count + 1), np.ones(count), [float(count)])),
        A_ub=matrix,
        b_ub=np.concatenate((wanted, -wanted, most, most, np.zeros(count))),
        bounds=limits,
        method="highs",
    )
    if found.x is None:
        return list(ramps)
    places = found.x[: count + 1].tolist()
    return [Ramp(ramp.start, ramp.end, places[k], places[k + 1]) for k, ramp in enumerate(ramps)]


def _sparse(rows: NDArray[np.intp], *columns: tuple[NDArray[np.intp], FloatArray], shape: tuple[int, int]) -> coo_array:
    """A matrix with a few numbers in each row."""
    from scipy.sparse import coo_array

    at = np.concatenate([column for column, _ in columns])
    values = np.concatenate([value for _, value in columns])
    return coo_array((values, (np.tile(rows, len(columns)), at)), shape=shape)
