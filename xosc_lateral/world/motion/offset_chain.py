"""Offsets of one segment as a few smooth transitions between lane offsets.

A lane offset action begins and ends with no lateral speed, whatever its shape, but for the linear one, which begins and
ends with a kink. So the offsets are followed by half cosines from one place to the next: as few as stay within the
tolerance, none of which turns the car faster than it may, and then led to where they err least. The turn of an action's
first frame is its lateral acceleration, pi^2 b / (2 T^2) for a change b over the time T, over the speed.

A lateral action of the scenario ends a chain, and begins with no lateral speed: the car turns by what it had. Where a
vehicle under test decides when, no transition is so fast that the turn would be seen (`MOST_HEADING`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import inf

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.ramp_targets import Ramp, acceleration, fitted, largest_change, slowing
from xosc_lateral.world.motion.segments import SegmentSpan
from xosc_lateral.world.road import RoadNetwork

SETTLING_TIME = 2.0
"""From the nominal offset at a segment's start to the sampled one, where the turn allows it. [s]"""
TOLERANCE = 0.010
"""How far transitions that lead from sampled offset to sampled offset may be from it. 1.3 cm takes a tenth fewer of
them, and 1 % of the chains more err by over 2 cm. [m]"""
MOST_TURNING = 0.026
"""Of the heading, within a transition: 0.26 mrad in a frame of 0.01 s. The reference player ends an action 1e-6 m short
of its target, up to 2 ms early, and turns the car by that much more in its last frame: up to 0.31 mrad. [rad/s]"""
MOST_HEADING = 0.9e-3
"""To the lane, of a car that a lateral action may come to at any time: it turns by so much in a frame then. 1 mrad may
be seen; the rest is for cars that are slower than nominally, up to the fifth by which egos are varied. [rad]"""
ASKEW = 2e-3
"""Heading to the lane of a car that gave up a lane change and stays so: to move aside would turn it at once. [rad]"""
GRID = 0.1
"""Time between places where a transition may begin or end. [s]"""
LONGEST = 4.0
"""Of a transition, once it has settled. [s]"""
LONGEST_CHAIN = 300.0
"""Of a chain that goes round: a run that is stopped by something that never happens lasts an hour. [s]"""
SLACK = 0.03
"""A transition is over that long before the next begins: a frame of the player and one more, to come to rest. [s]"""
LEAST_CHANGE = 1e-3
"""A smaller change of the target is left to the next one. [m]"""
FLIP_MARGIN = 0.3
"""Before and after a flip of +t in which no transition begins: the run may be a little early or late there. [s]"""
PLACED_ASIDE = np.array([0.01 * sign * k for k in range(11) for sign in (1, -1)])
"""From the sampled offset, the nearest first, where a chain begins with the scenario: a drift is met half way. [m]"""
REST = 0.1
"""Before a segment's end in which nothing turns the car any more: the maneuver that ends it may come a little early,
and begins with no lateral speed. [s]"""
_NONE = np.empty(0)
_TOO_FAST = 1e6
"""What turning faster than allowed costs: more than any number of transitions or centimetres. [-]"""
_SLOW = 3.0
"""A car that is slower is treated as this fast: it hardly turns by a lateral speed. [m/s]"""


class OffsetChain(Struct, frozen=True, eq=False):
    """Offsets of one entity on one segment.

    Parameters
    ----------
    entity : str
    time : array, shape (n,)
        Increasing. [s]
    offset_t : array, shape (n,)
        From the lane centre along +t, as ``AbsoluteTargetLaneOffset`` has it, the nominal offset included. [m]
    start_t : float
        Where the entity is when the chain begins, along +t: the first ramp leads from there, unless it is placed. [m]
    flips : tuple of float
        Times from which +t is on the vehicle's other side: it comes to a road that runs the other way. [s]
    speed : array, shape (n,)
        Of the entity: how fast it may move sideways. Empty: 30 m/s. [m/s]
    is_placed : bool
        The chain begins with the scenario, and the entity is put down at its first offset: no ramp has to lead there.
    goes_on : bool
        A lateral action, slowing down or the run's end ends the segment: it may last longer, and the chain goes round.
    is_overruled : bool
        A vehicle under test decides when a lateral action ends it.
    after_slow : bool
        It begins because the entity is no longer too slow.
    """

    entity: str
    time: FloatArray
    offset_t: FloatArray
    start_t: float = 0.0
    flips: tuple[float, ...] = ()
    speed: FloatArray = field(default_factory=lambda: np.empty(0))
    is_placed: bool = False
    goes_on: bool = False
    is_overruled: bool = False
    after_slow: bool = False


def offset_chains(
    motion: EntityMotion,
    network: RoadNetwork,
    deviation: FloatArray,
    spans: Sequence[SegmentSpan],
    *,
    tows: bool,
    beyond: Sequence[tuple[FloatArray, FloatArray]] = (),
    overruled_until: float = -inf,
) -> list[OffsetChain]:
    """Chains of one entity, with a deviation positive to the left of travel. [m]

    A chain begins where the one before has left the entity, unless something else moved it aside in between. One that
    tows a trailer is not put down beside the middle: the trailer would swing. `beyond` are times and deviations after
    each span's end, should it last longer; until `overruled_until` a vehicle under test may start a lateral action. [s]
    """
    chains: list[OffsetChain] = []
    held, end = 0.0, -1
    for k, span in enumerate(spans):
        overruled, lasts = bool(motion.time[span.first] < overruled_until), _may_last(motion, span.last)
        if lasts and span.end - span.start > LONGEST_CHAIN:
            last = int(np.searchsorted(motion.time, span.start + LONGEST_CHAIN))
            span = replace(span, last=last, end=float(motion.time[last]))
        is_supplied = k < len(beyond) and lasts and (overruled or not _is_lateral(motion, span.last + 1))
        chain = _offset_chain(motion, network, deviation, span, *(beyond[k] if is_supplied else (_NONE, _NONE)))
        chain = replace(chain, goes_on=lasts, is_overruled=overruled)
        if np.abs(np.sin(motion.heading_relative[span.first])) > ASKEW:
            continue
        if span.first == 0 and not tows:
            chain = replace(chain, start_t=float(chain.offset_t[0]), is_placed=True)
        if end >= 0 and not _moved_aside(motion, end + 1, span.first):
            chain = replace(chain, start_t=_direction(motion, network, span.first) * held)
        chains.append(chain)
        found = [ramp for ramp in ramps(chain) if ramp.start < span.end]
        at = int(np.searchsorted(motion.time, found[-1].start)) if found else span.first
        held = _direction(motion, network, at) * (found[-1].target if found else chain.start_t)
        end = span.last
    return chains


def _may_last(motion: EntityMotion, last: int) -> bool:
    """Whether a segment that ends in a row might have gone on: something is done then, or the run ends."""
    ends = last + 1 >= len(motion.time)
    return ends or _is_lateral(motion, last + 1) or bool(np.abs(motion.speed[last + 1]) < MINIMUM_SPEED)


def _is_lateral(motion: EntityMotion, row: int) -> bool:
    return row < len(motion.time) and bool(motion.activity[row] & (Activity.LATERAL | Activity.TRAJECTORY))


def _moved_aside(motion: EntityMotion, first: int, last: int) -> bool:
    activity = motion.activity[first : last + 1]
    aside = Activity.LATERAL | Activity.TRAJECTORY | Activity.TELEPORTED | Activity.OFF_ROAD
    return bool(((activity & aside) != 0).any() or ((activity & Activity.ACTIVE) == 0).any())


def _direction(motion: EntityMotion, network: RoadNetwork, row: int) -> float:
    """+1 where +t is to the left of the lane's travel, else -1."""
    return float(network.travel_directions(motion.road[row : row + 1], motion.lane[row : row + 1])[0])


def _offset_chain(
    motion: EntityMotion,
    network: RoadNetwork,
    deviation: FloatArray,
    span: SegmentSpan,
    later: FloatArray,
    beyond: FloatArray,
) -> OffsetChain:
    """All rows of a span, beginning at the nominal offset, and what is beyond its end, driven as at its end."""
    rows = slice(span.first, span.last + 1)
    along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
    offset = motion.offset[rows] + along_lane * deviation[rows]
    direction = network.travel_directions(motion.road[rows], motion.lane[rows])
    flips = motion.time[rows][1:][np.diff(direction) != 0]
    start_t = float(direction[0] * motion.offset[span.first])
    offset_t = np.append(direction * offset, direction[-1] * (motion.offset[span.last] + along_lane[-1] * beyond))
    speed = np.abs(np.append(motion.speed[rows], np.full(len(beyond), motion.speed[span.last])))
    time = np.append(motion.time[rows], later)
    after_slow = bool(span.first and np.abs(motion.speed[span.first - 1]) < MINIMUM_SPEED)
    return OffsetChain(motion.name, time, offset_t, start_t, tuple(flips.tolist()), speed=speed, after_slow=after_slow)


@lru_cache(maxsize=256)  # asked for by all who write a part of it
def ramps(chain: OffsetChain) -> tuple[Ramp, ...]:
    """As few transitions as the tolerance allows; the first leads from where the entity is.

    None begins around a flip of +t, where its target could be taken for one on the other side. One that has begun goes
    on beyond it: the player keeps to the side of travel that it began on.
    """
    first, last = float(chain.time[0]), float(chain.time[-1]) - REST
    if last - first < GRID:
        return ()
    speed = chain.speed if len(chain.speed) else np.full(len(chain.time), 30.0)
    grid = np.linspace(first, last, int((last - first) / GRID + 1e-6) + 1)
    offset = np.interp(grid, chain.time, _side(chain, chain.time) * chain.offset_t)
    driven = np.maximum(np.interp(grid, chain.time, speed), _SLOW)
    limit, most = MOST_TURNING * driven, np.full(len(grid), inf)
    if chain.is_overruled:
        most = MOST_HEADING * driven
        offset = _slower(grid, offset, 2.0 / np.pi * most, float(offset[0]) if chain.is_placed else chain.start_t)
    starts = offset[:1] + PLACED_ASIDE if chain.is_placed else np.array([chain.start_t])
    near = np.abs(grid[:, None] - np.array(chain.flips)[None, :]) < FLIP_MARGIN
    found = _transitions(grid, offset, limit, most, starts, settles=not chain.is_placed, barred=near.any(axis=1))
    side = _side(chain, np.array([ramp.start for ramp in found])).tolist()
    return tuple(
        replace(ramp, origin=way * ramp.origin, target=way * ramp.target) for ramp, way in zip(found, side, strict=True)
    )


def leading(origin: float, target: float, chain: OffsetChain) -> Ramp:
    """A transition from anywhere to a target, as fast as the chain's may be at its lowest speed."""
    slowest = max(float(chain.speed.min()) if len(chain.speed) else 30.0, _SLOW)
    change = abs(target - origin)
    by_turn = float(np.sqrt(acceleration(change, 1.0) / (MOST_TURNING * slowest)))
    by_speed = 0.5 * np.pi * change / (MOST_HEADING * slowest) if chain.is_overruled else 0.0
    return Ramp(0.0, max(by_turn, by_speed, SETTLING_TIME), origin, target)


def _slower(time: FloatArray, offset: FloatArray, most: FloatArray, start: float) -> FloatArray:
    """Offsets that go after others as fast as they may [m/s]: late, but always on the move. [m]"""
    found, at = np.empty(len(time)), start
    for k, step in enumerate(np.append(0.0, np.diff(time))):
        at += float(np.clip(offset[k] - at, -most[k] * step, most[k] * step))
        found[k] = at
    return found


def _side(chain: OffsetChain, time: FloatArray) -> FloatArray:
    """+1 where +t is on the side of travel that it is on at the chain's start, else -1."""
    return np.asarray(1.0 - 2.0 * (np.searchsorted(chain.flips, time, side="right") % 2))


def _transitions(
    time: FloatArray,
    offset: FloatArray,
    limit: FloatArray,
    most: FloatArray,
    starts: FloatArray,
    *,
    settles: bool,
    barred: NDArray[np.bool_],
) -> list[Ramp]:
    """The cheapest way over the grid: each transition costs 1, each squared excess over the tolerance as much again.

    None but the first begins where it is barred. Worked out from the end backwards (dynamic programming), for the first
    transition alone without a tolerance if it settles, and else from the best of the starts.
    """
    step, n = float(time[1] - time[0]), len(time)
    cost, following = np.full(n, inf), np.zeros(n, dtype=np.intp)
    cost[-1] = 0.0
    reach, change_of_speed = round(LONGEST / step), slowing(time, limit)
    at = float(starts[0])
    for i in [*(n - 2 - np.flatnonzero(~barred[1:-1][::-1])).tolist(), 0]:
        far = n - 1 if settles and i == 0 else min(i + reach, n - 1)
        ends = np.arange(i + 1, far + 1)
        for start in starts.tolist() if i == 0 else offset[i : i + 1].tolist():
            price = cost[ends] + 1.0 + _turning(offset, start, limit, change_of_speed, most, step, i, ends)
            price += _settling(step, ends) if settles and i == 0 else _excess(offset, start, i, ends)
            best = int(np.argmin(price))
            if price[best] < cost[i]:
                cost[i], following[i], at = price[best], ends[best], start
    found: list[Ramp] = []
    i = 0
    if cost[0] >= _TOO_FAST:
        return found  # too short a segment to get anywhere
    while i < n - 1:
        k = int(following[i])
        found.append(Ramp(float(time[i]), float(time[k]) - SLACK, at, float(offset[k])))
        at = float(offset[k])
        i = k
    return _needed(fitted(found, time, offset, limit, most, settles=settles, starts=len(starts) > 1))


def _needed(found: Sequence[Ramp]) -> list[Ramp]:
    """Without transitions to where it is already, which would only cost an event."""
    kept: list[Ramp] = []
    for ramp in found:
        at = kept[-1].target if kept else ramp.origin
        if abs(ramp.target - at) >= LEAST_CHANGE:
            kept.append(replace(ramp, origin=at))
    return kept


def _turning(
    offset: FloatArray,
    start: float,
    limit: FloatArray,
    change_of_speed: FloatArray,
    most: FloatArray,
    step: float,
    i: int,
    ends: NDArray[np.intp],
) -> FloatArray:
    """What turning or moving aside too fast costs."""
    rows = slice(i, int(ends[-1]) + 1)
    slowest, fastest = np.minimum.accumulate(limit[rows])[1:], np.maximum.accumulate(change_of_speed[rows])[1:]
    time = (ends - i) * step
    # Targets that keep the lateral speed over the whole time are found in the end.
    speed = np.minimum.accumulate(most[rows])[1:] * (time / (time - SLACK))
    excess = np.abs(offset[ends] - start) / largest_change(time - SLACK, slowest, fastest, speed * (1.0 + 1e-9))
    return np.where(excess > 1.0, _TOO_FAST * excess, 0.0)


def _settling(step: float, ends: NDArray[np.intp]) -> FloatArray:
    """What being settled earlier or later than usual costs."""
    late = ends * step - SETTLING_TIME
    return np.asarray(2.0 * np.abs(late) + 1e3 * np.maximum(late - 0.5, 0.0))


def _excess(offset: FloatArray, start: float, i: int, ends: NDArray[np.intp]) -> FloatArray:
    """Largest distance from the sampled offset over the tolerance, squared, where it is above 1."""
    span = int(ends[-1]) - i
    share = np.arange(span + 1)[None, :] / (ends - i)[:, None]
    curve = start + 0.5 * (1.0 - np.cos(np.pi * np.minimum(share, 1.0))) * (offset[ends] - start)[:, None]
    error = np.where(share <= 1.0, np.abs(curve - offset[None, i : i + span + 1]), 0.0).max(axis=1) / TOLERANCE
    return np.where(error > 1.0, 10.0 * (error**2 - 1.0), 0.0)
