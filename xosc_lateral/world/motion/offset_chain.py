"""Offsets over time as a ring of smooth moves within the lane, each from rest to rest.

A lane offset action begins and ends with no lateral speed. So a driver's path is followed by half cosines from one
place to the next. Where the joints lie is found by dynamic programming, on the squared error of place and of lateral
speed and a price for each joint; where the moves lead to by least squares [1]_. A path that looks at its place alone
has its joints on drifts, where the car would stop and go.

A ring ends where it begins and is driven for as long as nothing else moves the car sideways, which under a vehicle
under test is not for the nominal run to say.

References
----------
.. [1] R. Bellman, "On the approximation of curves by line segments using dynamic programming", Communications of the
       ACM 4(6), 1961: joints by dynamic programming.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.world.motion.trajectory import smoother_step

GRID = 0.1
"""Between places where a move may begin or end: above 5 Hz nobody steers. [s]"""
LONGEST_MOVE = 6.0
"""Longer ones are never the cheapest: drivers turn back every 2 to 4 s. [s]"""
ERROR_WEIGHTS = (1.0, 0.5, 0.2)
"""What errors of place, of lateral speed and of lateral acceleration count. [1/s], [-], [s]"""
JOINT_PRICE = 0.25
"""Of a move, as much as errors as large as the path's own speed for so long. With it the autocorrelation of the lateral
speed at 1 s is within 0.02 of the path's for profiles from 0.48 to 0.83; with 1 s it is 0.10 off for the former. [s]"""
MOST_ENLARGED = 1.2
"""Times what fits best: more is asked for by noise alone. [-]"""
ACTIVITY_TIME = 10.0
"""Over which a driver's own lateral speed is looked at: how lively he is varies over tens of seconds. [s]"""
LEAST_ACTIVITY = 1e-6
"""Slower than 1 mm/s nobody moves. [m2/s2]"""
DRIFT_TIME = 2.0
"""By how much of a lateral speed's way in it a place is off. [s]"""
REST_TIME = 0.03
"""A move is over that long before the next begins: a frame of the player, and one to start. [s]"""
STILL_TIME = 0.01
"""A lane offset action stands still in its first frame. [s]"""
CLOSING_TIME = 12.0
"""In which a ring's end is led to where it began. [s]"""
OFFSET_DECIMALS = 4
"""Decimals of an offset: the changes of a ring sum up to nothing, to the last of them. [-]"""


class Move(Struct, frozen=True):
    """One lane offset action: after a wait, sideways by a change, along half a cosine."""

    wait: float  # after the end of the one before [s]
    duration: float  # [s]
    change: float  # positive to the left of travel [m]

    @property
    def acceleration(self) -> float:
        """Largest lateral acceleration, at its beginning and end. [m/s2]"""
        return float(0.5 * np.pi**2 * abs(self.change) / self.duration**2)


class Ring(Struct, frozen=True):
    """Moves that lead back to where the first one began: `origin`, positive left. [m]"""

    origin: float
    moves: tuple[Move, ...]


class OffsetPath(Struct, frozen=True):
    """Places by the distance driven: what is driven slowly or stands moves sideways slowly or not at all."""

    distance: tuple[float, ...]  # from where it begins, increasing [m]
    offset: tuple[float, ...]  # positive left [m]


class OffsetChain(Struct, frozen=True):
    """The moves of one entity after one action, or from the start."""

    entity: str
    after: tuple[str, ...] | None  # names from the story down of the action whose end begins it; None: from the start
    ring: Ring  # its offsets are from where the entity is by its maneuvers
    # placed_t: the entity is put down there, along +t from the lane's centre, and the ring begins at once; None: it is
    # led to the ring's origin [m]
    placed_t: float | None = None
    side: float = 1.0  # +1 where +t is to the left of travel, else -1
    path: OffsetPath | None = None  # driven before the ring, by an entity that is put down at its beginning


class Size(NamedTuple):
    """How much of a chain is driven: times what was sampled, and how far from the middle, of the largest offset. [-]"""

    factor: float = 1.0
    limit: float = 1.0


def resized(chain: OffsetChain, size: Size) -> OffsetChain:
    """With moves of another size that take as long, and without a path; none at all with a factor of 0."""
    ring, placed, factor = chain.ring, chain.placed_t, size.factor
    places = np.cumsum([ring.origin, *(move.change for move in ring.moves[:-1])])
    farthest = size.limit * np.abs(places).max()
    places = np.round(factor * np.clip(places, -farthest, farthest), OFFSET_DECIMALS)
    changes = np.round(np.diff(np.append(places, places[:1])), OFFSET_DECIMALS).tolist() if factor else ()
    moves = tuple(replace(move, change=change) for move, change in zip(ring.moves, changes, strict=False) if change)
    if placed is not None:
        begun = ring.origin if chain.path is None else chain.path.offset[0]
        placed -= chain.side * (begun - float(places[0]))
    return replace(chain, ring=Ring(float(places[0]), moves), placed_t=placed, path=None)


def ring_along(time: FloatArray, offset: FloatArray, *, from_middle: bool) -> Ring:
    """The closed ring along offsets [m] over time [s]; it begins at a turn or, `from_middle`, where it is near to 0."""
    grid = np.arange(time[0], time[-1] + 1e-9, GRID)
    path = closed(np.interp(grid, time, offset))
    rate = _rate(path)
    turns = np.flatnonzero(rate * np.roll(rate, 1) <= 0.0)
    first = int(turns[0]) if len(turns) else 0
    if from_middle:
        first = int(np.argmin(np.abs(path) + DRIFT_TIME * np.abs(rate)))
    path = np.roll(path, -first)
    joints = joints_of(path)
    if len(joints) < 2:
        return Ring(round(float(path[0]), OFFSET_DECIMALS), ())
    places = np.round(places_of(path, joints), OFFSET_DECIMALS)
    return Ring(float(places[0]), _moves(joints, len(path), places))


def closed(path: FloatArray) -> FloatArray:
    """One turn of a closed path, on the grid: as much of an open one as ends most like it begins, led to its begin."""
    rate = np.gradient(path, GRID)
    half = len(path) // 2
    unlike = np.abs(path - path[0]) + DRIFT_TIME * np.abs(rate - rate[0])
    last = half + int(np.argmin(unlike[half:]))
    turn = path[: last + 1].copy()
    to_end = GRID * np.arange(last, -1, -1.0)
    turn += (turn[0] - turn[-1]) * smoother_step(1.0 - to_end / min(CLOSING_TIME, GRID * last))
    return turn[:-1]


def _rate(path: FloatArray) -> FloatArray:
    """Lateral speed of a closed path, between the rows before and after. [m/s]"""
    return np.asarray((np.roll(path, -1) - np.roll(path, 1)) / (2.0 * GRID))


def joints_of(path: FloatArray) -> IntArray:
    """Rows of a closed path at which moves begin, the first of them 0, where the sum of all costs is least."""
    n = len(path)
    reach = min(round(LONGEST_MOVE / GRID), n)
    cost = _costs(path, reach)
    total, following = np.full(n + 1, np.inf), np.zeros(n, dtype=np.int64)
    total[n] = 0.0
    for row in range(n - 1, -1, -1):
        far = min(reach, n - row)
        price = cost[row, :far] + total[row + 1 : row + far + 1]
        best = int(np.argmin(price))
        total[row], following[row] = price[best], row + 1 + best
    joints = [0]
    while following[joints[-1]] < n:
        joints.append(int(following[joints[-1]]))
    return np.array(joints)


def _costs(path: FloatArray, reach: int) -> FloatArray:
    """Cost of a move from each row over 1 to `reach` steps, from path to path, shape (n, reach). [-]

    With d the change, the squared error of d times a share is d^2 times the share's square, less twice d times its
    product with the path, plus the path's square: sums that are the same for all moves of a length.
    """
    n = len(path)
    windows, weight = (_windows(values, reach) for values in (path, 1.0 / _activity(path)))
    share = np.array([_shares(steps, reach) for steps in range(1, reach + 1)])
    real = windows - windows[:, :1]
    change = real[:, 1:]
    cost, within = np.full((n, reach), JOINT_PRICE), np.tri(reach, reach + 1, 1)
    for factor in ERROR_WEIGHTS:
        seen = share * within
        squares, both = weight @ (seen**2).T, (weight * real) @ seen.T
        cost += factor**2 * GRID * (change**2 * squares - 2.0 * change * both + (weight * real**2) @ within.T)
        share, real = np.diff(share) / GRID, np.diff(real) / GRID
        weight, within = weight[:, 1:], within[:, 1:]
    return cost


def _windows(path: FloatArray, reach: int) -> FloatArray:
    """Each row of a closed path and the `reach` rows after it."""
    around = np.concatenate((path, path[:reach]))
    return np.lib.stride_tricks.sliding_window_view(around, reach + 1)[: len(path)]


def _activity(path: FloatArray) -> FloatArray:
    """Mean square of the lateral speed around each row: a calm driver's errors weigh more. [m2/s2]"""
    width = min(round(ACTIVITY_TIME / GRID), len(path))
    return np.asarray(np.roll(_windows(_rate(path) ** 2, width).mean(axis=1), width // 2) + LEAST_ACTIVITY)


def _shares(steps: int, reach: int) -> FloatArray:
    """How much of a move over so many steps is done after 0 to `reach` of them. [-]"""
    duration = steps * GRID - REST_TIME
    done = np.clip((GRID * np.arange(reach + 1) - STILL_TIME) / duration, 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * done))


def places_of(path: FloatArray, joints: IntArray) -> FloatArray:
    """Places at the joints of a closed path with which the moves between them err least, and are as fast as it. [m]

    Least squares lead to less movement than is fitted: all changes are enlarged alike, until lateral speeds agree.
    """
    n, count = len(path), len(joints)
    ends = np.append(joints[1:], n)
    design = np.zeros((n + 1, count))
    for k, (begin, end) in enumerate(zip(joints.tolist(), ends.tolist(), strict=True)):
        share = _shares(end - begin, end - begin)
        design[begin : end + 1, k] = 1.0 - share
        design[begin : end + 1, (k + 1) % count] = share
    whole = np.append(path, path[0])
    weight = np.append(1.0, np.sqrt(1.0 / _activity(path)))
    rows, wanted = list[FloatArray](), list[FloatArray]()
    speeds = np.diff(design, axis=0), np.diff(whole)
    for factor in ERROR_WEIGHTS:
        rows.append(factor * weight[: len(design), None] * design)
        wanted.append(factor * weight[: len(design)] * whole)
        design, whole = np.diff(design, axis=0) / GRID, np.diff(whole) / GRID
    places = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=None)[0]
    squares = float(np.sum((speeds[0] @ places) ** 2))
    larger = min(float(np.sqrt(np.sum(speeds[1] ** 2) / squares)), MOST_ENLARGED) if squares > 0.0 else 1.0
    return np.asarray(places.mean() + larger * (places - places.mean()))


def _moves(joints: IntArray, rows: int, places: FloatArray) -> tuple[Move, ...]:
    """From place to place, without moves to where the car is already: those after them wait."""
    moves: list[Move] = []
    wait = 0.0
    changes = np.round(np.diff(np.append(places, places[0])), OFFSET_DECIMALS)
    for steps, change in zip(np.diff(np.append(joints, rows)).tolist(), changes.tolist(), strict=True):
        if change == 0.0:
            wait += GRID * steps
            continue
        moves.append(Move(wait, GRID * steps - REST_TIME, change))
        wait = 0.0
    return tuple(moves)
