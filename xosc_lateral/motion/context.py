"""What a driver in the scenario may react to: DESIGN's context names as time series along each vehicle's motion.

Distances between vehicles are free space: from bumper to bumper along the lane, 0 while they overlap lengthwise,
infinite where nobody is within reach, NaN where there is no such lane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.motion.nearby import pairs_within
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario import BoundingBox
from xosc_lateral.scenario.actions.environment import EnvironmentAction
from xosc_lateral.scenario.enums import VehicleCategory
from xosc_lateral.scenario.environment import Environment, Weather

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

REACH = 200.0
"""How far a driver looks for others [m]; beyond it there is none (about what a series radar sees)."""

IN_SIGHT = 2.0 * REACH + 100.0
"""Vehicles never nearer than this in a straight line are not looked for along the lane. Free space is counted along the
reference line, which on the tightest ramp is half as long as its outer lane; the rest is for two road trains. [m]"""

ALONGSIDE = 10.0
"""A vehicle in the next lane counts as alongside within this free space lengthwise. [m]"""

CELLS = 100_000
"""Rows of all others that are looked at together: as many as stay in a processor's cache. [-]"""

TRUCKS = frozenset({VehicleCategory.TRUCK, VehicleCategory.SEMITRAILER, VehicleCategory.TRAILER, VehicleCategory.BUS})


def entity_context(motion: NominalMotion, network: RoadNetwork, index: int, grid: IntArray) -> dict[str, FloatArray]:
    """Context of one vehicle on chosen rows.

    Parameters
    ----------
    motion : NominalMotion
    network : RoadNetwork
    index : int
        Of the vehicle in ``motion.entities``.
    grid : array of int, shape (n,)
        Rows of the motion.

    Returns
    -------
    dict of str to array, shape (n,)
        Under DESIGN's names; NaN where there is none (no lane to that side; off the road), infinite where a lane has
        nobody within reach. Weather that the scenario does not state is absent.
    """
    entity = motion.entities[index]
    road = _road(entity, network, grid)
    around = _neighbours(motion, network, index, grid)
    return _own_motion(entity, grid) | road | around | _empty_lanes(road, around) | _weather(motion, entity, grid)


def _own_motion(entity: EntityMotion, grid: IntArray) -> dict[str, FloatArray]:
    speed = entity.speed
    if len(speed) > 1:
        # over one second: what a speed step does within one row is no acceleration that anybody feels
        window = max(1, round(0.5 / (entity.time[1] - entity.time[0])))
        first, last = np.maximum(grid - window, 0), np.minimum(grid + window, len(speed) - 1)
        acceleration = (speed[last] - speed[first]) / (entity.time[last] - entity.time[first])
    else:
        acceleration = np.zeros(len(grid))
    is_truck = np.full(len(grid), float(entity.entity.vehicle_category in TRUCKS))
    return {"speed": speed[grid].copy(), "acceleration": acceleration, "is_truck": is_truck}


def _road(entity: EntityMotion, network: RoadNetwork, grid: IntArray) -> dict[str, FloatArray]:
    on = entity.road[grid] >= 0
    rows = grid[on]
    road, lane, s = entity.road[rows], entity.lane[rows], entity.s[rows]
    lane_index, lane_count = network.lane_index(road, lane, s)
    values: dict[str, FloatArray] = {
        "curvature": network.lane_curvature(road, lane, s, entity.offset[rows]),
        "lane_width": network.lane_width(road, lane, s),
        "lane_index": np.where(lane_index >= 0, lane_index, np.nan).astype(np.float64),
        "lane_count": lane_count.astype(np.float64),
        "crossfall": network.crossfall(road, lane, s),
        "grade": network.grade(road, lane, s),
    }
    context = {}
    for name, part in values.items():
        context[name] = np.full(len(grid), np.nan)
        context[name][on] = part
    return context


# ---- other vehicles --------------------------------------------------------------------------------------------------
class _Reach(NamedTuple):
    """A lane section within reach along the own lane: u(s) = at + sign * (s - s_entry) counts along travel. [m]"""

    road: int
    s_low: float
    s_high: float
    lane: int
    at: float
    s_entry: float
    sign: int


def _lane_path(network: RoadNetwork, road: int, lane: int, s: float) -> list[_Reach]:
    """Sections along a lane within `REACH` both ways, in a coordinate u that is 0 at `s` and grows along travel."""
    forward = network.travel_direction(road, lane)
    low, high = network.section_at(road, s)
    path = [_Reach(road, low, high, lane, 0.0, s, forward)]
    for way in (1, -1):
        here, direction, done = (road, lane, s), way * forward, 0.0
        while done < REACH + (high - low):
            section = network.section_at(here[0], here[2])
            left = (section[1] - here[2]) if direction > 0 else (here[2] - section[0])
            step = network.advance(*here, left + _INTO_NEXT, direction=direction)
            if step.remaining > 0.0:
                break
            done += left
            here, direction = (step.road, step.lane, step.s), step.direction
            start, end = network.section_at(step.road, step.s)
            s_entry = step.s - direction * _INTO_NEXT
            path.append(_Reach(step.road, start, end, step.lane, way * done, s_entry, way * direction))
    return path


_INTO_NEXT = 1e-6
"""Step beyond a section's end that brings one into the next. [m]"""


class _Others(NamedTuple):
    """Where another vehicle is, seen along the own lane: u ahead [m], lane steps to the left, same direction or not."""

    ahead: FloatArray
    lanes_left: FloatArray
    oncoming: NDArray[np.bool_]


def _neighbours(motion: NominalMotion, network: RoadNetwork, index: int, grid: IntArray) -> dict[str, FloatArray]:
    own = motion.entities[index]
    n = len(grid)
    nearest = {side: np.full(n, np.inf) for side in ("lead", "left", "right", "oncoming")}
    truck = {side: np.zeros(n) for side in ("lead", "left", "right")}
    groups = _own_lane_groups(own, network, grid)
    directions = _travel(motion, network)
    numbers = [k for k in _in_sight(motion)[index] if motion.entities[k].entity.is_vehicle]
    together = max(1, CELLS // n)
    for begin in range(0, len(numbers), together):
        part = numbers[begin : begin + together]
        others = [motion.entities[k] for k in part]
        seen = _see(others, np.stack([directions[k][grid] for k in part]), grid, groups)
        gap = _free_space(seen, own.entity.bounding_box, [other.entity.bounding_box for other in others])
        is_truck = np.array([float(other.entity.vehicle_category in TRUCKS) for other in others])
        for side, there in _sides(seen).items():
            with np.errstate(invalid="ignore"):
                gaps = np.where(there & (gap <= REACH), gap, np.inf)
            first = gaps.argmin(axis=0)
            smallest = gaps[first, np.arange(n)]
            closer = smallest < nearest[side]
            nearest[side][closer] = smallest[closer]
            if side in truck:
                truck[side][closer] = is_truck[first[closer]]
    return _as_columns({side: np.where(np.isinf(gap), np.nan, gap) for side, gap in nearest.items()}, truck)


def _sides(seen: _Others) -> dict[str, NDArray[np.bool_]]:
    """Rows in which the other one is ahead, beside or comes towards us, shape (others, n) each."""
    same_way = ~seen.oncoming
    return {
        "lead": same_way & (seen.lanes_left == 0) & (seen.ahead > 0),
        "left": same_way & (seen.lanes_left == 1),
        "right": same_way & (seen.lanes_left == -1),
        "oncoming": seen.oncoming & (seen.ahead > 0),
    }


def _as_columns(nearest: Mapping[str, FloatArray], truck: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Distances [m] and kinds of what is nearest on every side, shape (n,) each, by the names of context columns."""
    context = {f"{side}_distance": distance for side, distance in nearest.items()}
    context |= {f"{side}_is_truck": flag for side, flag in truck.items()}
    for side in ("left", "right"):
        alongside = np.nan_to_num(nearest[side], nan=np.inf) <= ALONGSIDE
        # the same as measured drives often have it: a flag for what drives beside
        context[f"truck_{side}"] = (alongside & (truck[side] > 0)).astype(np.float64)
        context[f"car_{side}"] = (alongside & (truck[side] == 0)).astype(np.float64)
    return context


def _empty_lanes(road: Mapping[str, FloatArray], around: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Distances that say so where there is a lane but nobody in it."""
    index, count = road["lane_index"], road["lane_count"]
    there = {"lead": index >= 0, "right": index > 0, "left": index < count - 1}
    names = {side: f"{side}_distance" for side in there}
    return {name: np.where(there[side] & np.isnan(around[name]), np.inf, around[name]) for side, name in names.items()}


@lru_cache(maxsize=1)  # asked for every entity of one motion after another
def _in_sight(motion: NominalMotion) -> tuple[tuple[int, ...], ...]:
    """For every entity those that it may see along its lane: whoever is not near in space is not near on the road."""
    there = [(entity.activity & Activity.ACTIVE) != 0 for entity in motion.entities]
    x, y = (
        [np.where(on, values, np.nan) for on, values in zip(there, axis, strict=True)]
        for axis in ([entity.x for entity in motion.entities], [entity.y for entity in motion.entities])
    )
    seen: list[list[int]] = [[] for _ in motion.entities]
    for a, b in pairs_within(x, y, IN_SIGHT):
        seen[a].append(b)
        seen[b].append(a)
    return tuple(tuple(sorted(others)) for others in seen)


def _own_lane_groups(
    own: EntityMotion, network: RoadNetwork, grid: IntArray
) -> list[tuple[IntArray, FloatArray, list[_Reach]]]:
    """Rows of the grid that share one lane path: positions in the grid, own u there, and the path."""
    groups: dict[tuple[int, int, float], list[int]] = {}
    present = ((own.activity[grid] & Activity.ACTIVE) != 0) & (own.road[grid] >= 0) & (own.lane[grid] != 0)
    for k in np.flatnonzero(present):
        row = grid[k]
        road, lane, s = int(own.road[row]), int(own.lane[row]), float(own.s[row])
        groups.setdefault((road, lane, network.section_at(road, s)[0]), []).append(int(k))
    result = []
    for (road, lane, _), members in groups.items():
        rows = np.array(members)
        along = own.s[grid[rows]]
        path = _lane_path(network, road, lane, float(along[0]))
        result.append((rows, path[0].sign * (along - along[0]), path))
    return result


def _see(
    others: Sequence[EntityMotion],
    direction: NDArray[np.int8],
    grid: IntArray,
    groups: list[tuple[IntArray, FloatArray, list[_Reach]]],
) -> _Others:
    """Others along the own lane, shape (others, n); `direction` is which way they drive, 0: on no lane."""
    shape = direction.shape
    seen = _Others(np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=bool))
    road, lane, s = (np.stack([getattr(one, name)[grid] for one in others]) for name in ("road", "lane", "s"))
    for members, own_u, path in groups:
        for part in path:
            on = (direction[:, members] != 0) & (road[:, members] == part.road)
            on &= (s[:, members] >= part.s_low - 1e-9) & (s[:, members] <= part.s_high + 1e-9)
            who, at = np.nonzero(on)
            if not len(who):
                continue
            k = members[at]
            ahead = part.at + part.sign * (s[who, k] - part.s_entry) - own_u[at]
            # the own lane path may pass a place twice (a ring road): the nearer view counts
            nearer = ~(np.abs(seen.ahead[who, k]) <= np.abs(ahead))
            who, k, ahead = who[nearer], k[nearer], ahead[nearer]
            seen.ahead[who, k] = ahead
            seen.lanes_left[who, k] = part.sign * (_rank(lane[who, k]) - _rank(np.int64(part.lane)))
            seen.oncoming[who, k] = direction[who, k] != part.sign
    return seen


@lru_cache(maxsize=1)  # asked for every entity of one motion after another
def _travel(motion: NominalMotion, network: RoadNetwork) -> tuple[NDArray[np.int8], ...]:
    """For every entity which way it drives along s, +1 or -1, shape (rows,); 0 where it is on no lane."""
    directions = []
    for entity in motion.entities:
        present = ((entity.activity & Activity.ACTIVE) != 0) & (entity.road >= 0) & (entity.lane != 0)
        direction = np.zeros(len(present), dtype=np.int8)
        direction[present] = network.travel_directions(entity.road[present], entity.lane[present])
        directions.append(np.where(np.cos(entity.heading_relative) < 0.0, -direction, direction))
    return tuple(directions)


def _rank(lane: NDArray[np.integer] | np.integer) -> IntArray:
    """Lane ids without the gap at the centre lane 0: differences count lanes along +t."""
    return np.where(lane > 0, lane - 1, lane).astype(np.int64)


def _free_space(seen: _Others, own: BoundingBox, others: Sequence[BoundingBox]) -> FloatArray:
    """Bumper to bumper, shape (others, n); 0 while overlapping lengthwise. [m]"""
    centre, length = (np.array([[getattr(box, name)] for box in others]) for name in ("center_x", "length"))
    turned = np.where(seen.oncoming, -1.0, 1.0)
    between_centres = seen.ahead + turned * centre - own.center_x
    return np.asarray(np.maximum(np.abs(between_centres) - 0.5 * (own.length + length), 0.0))


# ---- weather and time of day -----------------------------------------------------------------------------------------
def _weather(motion: NominalMotion, entity: EntityMotion, grid: IntArray) -> dict[str, FloatArray]:
    time = entity.time[grid]
    context: dict[str, FloatArray] = {}
    for played in motion.actions:
        content = played.action.content
        if not isinstance(content, EnvironmentAction):
            continue
        since = time >= played.start - 1e-9
        for name, values in _stated(content.environment, time, played.start, entity.heading[grid]).items():
            context.setdefault(name, np.full(len(grid), np.nan))[since] = values[since]
    return context


def _stated(environment: Environment, time: FloatArray, start: float, heading: FloatArray) -> Mapping[str, FloatArray]:
    """What one environment states, in DESIGN's units."""
    one = np.ones(len(time))
    values: dict[str, FloatArray] = {}
    clock = environment.time_of_day
    if clock is not None:
        seconds = clock.date_time.hour * 3600.0 + clock.date_time.minute * 60.0 + clock.date_time.second
        running = time - start if clock.animation else 0.0
        values["time_of_day"] = (seconds + running) / 3600.0 % 24.0 * one
    if environment.friction_scale_factor is not None:
        values["friction"] = environment.friction_scale_factor * one
    weather = environment.weather
    return values if weather is None else values | _stated_weather(weather, one, heading)


def _stated_weather(weather: Weather, one: FloatArray, heading: FloatArray) -> dict[str, FloatArray]:
    """Light, rain and wind, shape (n,) each."""
    values: dict[str, FloatArray] = {}
    if weather.illuminance is not None:
        values["illuminance"] = weather.illuminance * one
    if weather.precipitation_type == "dry":
        values["rain"] = 0.0 * one
    elif weather.precipitation_type == "rain" and weather.precipitation_intensity is not None:
        values["rain"] = weather.precipitation_intensity * one
    if weather.wind_speed is not None and weather.wind_direction is not None:
        values["wind_speed"] = weather.wind_speed * one
        # 90 deg blows to the left of travel; the standard's direction is where the wind blows to, against world x
        values["wind_direction"] = np.degrees(weather.wind_direction - heading) % 360.0
    return values
