"""Vehicles side by side give way to each other: sampled paths, moved apart as real neighbours are.

Every vehicle's path is sampled by itself first. Where two drive side by side, the lateral gap that this leaves between
them is mapped to the gap that real neighbours leave at the same quantile: gaps between vehicles side by side beside
those between any two vehicles of the two lanes (`GAP_QUANTILES`), or beside those that profiles leave which keep away
from neighbours by themselves, in the mean (`RESPONDING_GAPS`). The narrower the gap would be, the more it is widened;
both vehicles take their part, the one in the overtaking lane the larger one, as measured. The mapping fades with the
free space lengthwise. Of what profiles leave, all is the overtaking one's: the other keeps as far away as real ones
do, by itself. All displacements follow from the paths as first sampled, so nobody's depends on the order of entities,
and a vehicle far away changes nobody's.

Our own rule: quantile mapping to gaps that were measured in DLR Highway Traffic v1.1.0 (laboratory/give_way.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings.around import smooth_step, stretches_within
from xosc_lateral.world.surroundings.context import ROWS_TOGETHER, STEERING_DURATION

GAP_QUANTILES = (
    np.array([-0.68, -0.05, 0.37, 0.76, 1.29, 1.65, 3.0]),
    np.array([0.41, 0.75, 0.99, 1.27, 1.59, 1.86, 3.0]),
)
"""Lateral gap between any vehicles of neighbouring lanes, and between those side by side, at the same quantiles (the
least, 0.1, 1, 5, 25 and 50 %): DLR Highway Traffic, 744 encounters (`laboratory/give_way.py`). From 3 m on nobody
gives way, which is assumed. [m]"""

RESPONDING_GAPS = np.array([0.04, 0.26, 0.56, 0.95, 1.43, 1.75, 3.0])
"""Lateral gap that vehicles leave by themselves whose profiles know what neighbours do, at the same quantiles:
those side by side in the same recording, sampled from `motorway` under its context, 12 seeds
(`laboratory/give_way.py`). [m]"""

OVERTAKING_SHARE = 0.84
"""Part of the one in the overtaking lane, by the law alone: it moves 0.239 m, the other 0.045 m (same recording,
alongside; `laboratory/clearance.py`). [-]"""

FADE_DISTANCE, RESPONDING_FADE_DISTANCE = 60.0, 20.0
"""Free space lengthwise within which neighbours matter less and less, to profiles that do not respond to them, and
beyond what profiles do that respond: `motorway` leaves 0.030 m of what real vehicles move from whom they overtake
alongside, 0.002 m of it at up to 20 m of free space, and nothing farther away (same recording). [m]"""

ENTERING_GAP = 0.5
"""Nominal lateral gap over which a vehicle that crosses into a lane becomes its neighbour. [m]"""


@dataclass(frozen=True, eq=False)
class SampledVehicle:
    """A vehicle and its sampled path."""

    motion: EntityMotion  # nominal
    deviation: FloatArray  # from it on the rows that are looked at, positive left, shape (n,) [m]
    can_move: BoolArray  # on which of them its path is sampled and may be moved, shape (n,)
    # responds: sides, "left" and "right", on which its profile responds to neighbours by itself: there, gaps are
    # widened by what that leaves to be widened
    responds: frozenset[str] = frozenset()
    # answer_known: sides on which its answer to neighbours is known to be what its profile says: there the law moves it
    # nowhere
    answer_known: frozenset[str] = frozenset()


def give_way(
    motion: NominalMotion, network: RoadNetwork, sampled: Sequence[SampledVehicle], rows: IntArray
) -> list[FloatArray | None]:
    """By how much each vehicle of a motion, `sampled` in its order, moves aside on evenly spaced rows, positive left.

    None: not at all. Shape (n,). [m]
    """
    count, n = len(sampled), len(rows)
    left, right, none = np.empty((count, n)), np.empty((count, n)), np.zeros(n)
    kinds = (np.float64, np.float64, np.float64, np.float64, bool, bool)
    tables = [np.empty((count, n), kind) for kind in kinds]  # x, y, heading, deviation, can_move, present
    left_hand = np.zeros(count, dtype=bool)
    for k, samples in enumerate(sampled):
        entity, box, heading = samples.motion, samples.motion.entity.bounding_box, samples.motion.heading[rows]
        x = entity.x[rows] + box.center_x * np.cos(heading)
        y = entity.y[rows] + box.center_x * np.sin(heading)
        on_road = np.flatnonzero(entity.road[rows] >= 0)  # the first road says whether it drives where one keeps left
        left_hand[k] = bool(len(on_road)) and network.roads[int(entity.road[rows[on_road[0]]])].rule == "LHT"
        present = ((entity.activity[rows] & Activity.ACTIVE) != 0) & entity.entity.is_vehicle
        columns = (none, none, x, y, heading, samples.deviation, samples.can_move, present)
        for table, values in zip((left, right, *tables), columns, strict=True):
            table[k] = values
    there_x, there_y = (
        (np.where(there, row, np.nan) for row, there in zip(table, tables[-1], strict=True)) for table in tables[:2]
    )
    boxes = [samples.motion.entity.bounding_box for samples in sampled]
    length, width = (np.array([getattr(box, name) for box in boxes]) for name in ("length", "width"))
    can_move = [samples.can_move.any() for samples in sampled]
    responses = Response(*(
        np.array([side in getattr(samples, name) for samples in sampled], dtype=bool)
        for name in ("responds", "answer_known") for side in ("left", "right")
    ))  # fmt: skip
    for stretch, near_pairs in stretches_within(
        there_x, there_y, FADE_DISTANCE + length.max(initial=0.0) + REACH_MARGIN
    ):
        meeting = [pair for pair in near_pairs if can_move[pair[0]] or can_move[pair[1]]]
        part = [table[:, stretch] for table in tables]
        for vehicle, other in _together(meeting, part[0].shape[1]):
            near = np.flatnonzero(_rows_near(part, length, vehicle, other))
            number, at = np.divmod(near, part[0].shape[1])
            vehicle, other = vehicle[number], other[number]
            first, second = (
                BodyFrame._make([*(table[one, at] for table in part[:-1]), length[one], width[one]])
                for one in (vehicle, other)
            )
            response = Response._make(column[vehicle] for column in responses)
            aside = moved_aside(first, second, response, left_hand[vehicle])
            np.maximum.at(right[:, stretch], (vehicle, at), np.maximum(0.0 - aside, 0.0))
            np.maximum.at(left[:, stretch], (vehicle, at), np.maximum(aside, 0.0))
    every = max(1, int(rows[1] - rows[0])) if n > 1 else 1
    smoothed = STEERING_DURATION / (motion.step * every)
    result: list[FloatArray | None] = []
    for k in range(count):
        aside = left[k] - right[k]
        result.append(_smoothed(aside, smoothed) if aside.any() else None)
    return result


def _together(meeting: Sequence[tuple[int, int]], n: int) -> Iterator[tuple[IntArray, IntArray]]:
    """Both of each pair, each as the one who looks at the other, as many pairs as are looked at at once."""
    pairs = np.array([pair for i, j in meeting for pair in ((i, j), (j, i))], dtype=np.int64).reshape(-1, 2)
    step = max(1, ROWS_TOGETHER // max(n, 1))
    for begin in range(0, len(pairs), step):
        yield pairs[begin : begin + step, 0], pairs[begin : begin + step, 1]


def _rows_near(tables: Sequence[NDArray[Any]], length: FloatArray, vehicle: IntArray, other: IntArray) -> BoolArray:
    """Where pairs of vehicles are near enough for `moved_aside`, shape (pairs, n); `tables`: x, y ... of all."""
    x, y, present = tables[0], tables[1], tables[-1]
    reach = (FADE_DISTANCE + 0.5 * (length[vehicle] + length[other]) + REACH_MARGIN)[:, None]
    away = (x[other] - x[vehicle]) ** 2 + (y[other] - y[vehicle]) ** 2
    return np.asarray(present[vehicle] & present[other] & (away < reach**2))


REACH_MARGIN = 10.0
"""Added to the reach for what lies aside: more than two widths and deviations. [m]"""


class BodyFrame(NamedTuple):
    """Vehicles on rows: middle, heading, size, where present and free to move; one, or another in each row."""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    deviation: FloatArray
    can_move: BoolArray
    length: FloatArray
    width: FloatArray


class Response(NamedTuple):
    """What is known of drivers, shape (n,) each; see `SampledVehicle`."""

    responds_left: BoolArray
    responds_right: BoolArray
    alone_left: BoolArray
    alone_right: BoolArray


def moved_aside(vehicle: BodyFrame, other: BodyFrame, response: Response, left_hand: bool | BoolArray) -> FloatArray:
    """By how much each moves aside for another that is near, positive left, shape (n,). [m]

    By itself `motorway` moves 0.209 m from whom it overtakes and 0.083 m from who overtakes it, where real vehicles
    move 0.239 and 0.045 m: the second has done more than its part already. One whose answer is known of the driver
    alone has no part at all.
    """
    ahead_x, ahead_y = other.x - vehicle.x, other.y - vehicle.y
    cos, sin = np.cos(vehicle.heading), np.sin(vehicle.heading)
    along, aside = ahead_x * cos + ahead_y * sin, ahead_y * cos - ahead_x * sin
    same_way = np.cos(other.heading - vehicle.heading) > 0.9
    is_left = aside > 0
    nominal = np.abs(aside) - 0.5 * (vehicle.width + other.width)
    gap = nominal + np.where(is_left, 1.0, -1.0) * (other.deviation - vehicle.deviation)
    free = np.maximum(np.abs(along) - 0.5 * (vehicle.length + other.length), 0.0)
    responding = np.where(is_left, response.responds_left, response.responds_right)
    weight = 1.0 - smooth_step(free / np.where(responding, RESPONDING_FADE_DISTANCE, FADE_DISTANCE))
    weight *= smooth_step(nominal / ENTERING_GAP) * same_way
    widened = weight * np.where(responding, wider(gap, responding=True), wider(gap, responding=False))
    share = np.where(responding, 1.0, OVERTAKING_SHARE)
    share = np.where(other.can_move, np.where(is_left == left_hand, share, 1.0 - share), 1.0)
    share *= ~np.where(is_left, response.alone_left, response.alone_right)
    moved = widened * share * vehicle.can_move
    return np.where(is_left, 0.0 - moved, moved)  # no negative zeros


def wider(gap: FloatArray, *, responding: bool) -> FloatArray:
    """What gaps to somebody are widened by, to whom the profile responds by itself or not, shape (n,). [m]"""
    free, side_by_side = GAP_QUANTILES
    free = RESPONDING_GAPS if responding else free
    wanted = np.interp(gap, free, side_by_side)
    wanted = np.where(gap < free[0], side_by_side[0], wanted)
    return np.asarray(np.maximum(wanted - gap, 0.0) * (gap < free[-1]))


def _smoothed(values: FloatArray, width: float) -> FloatArray:
    half = min(int(np.ceil(4.0 * width)), max(len(values) - 1, 0))
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return np.asarray(np.convolve(np.pad(values, half, mode="edge"), kernel / kernel.sum(), "valid"))
