"""What a driver in the scenario may react to: the context, as time series along each vehicle's motion.

Distances between vehicles are free space: from bumper to bumper along the lane, 0 while they overlap lengthwise,
infinite where nobody is within reach, NaN where there is no such lane.

Everything is continuous in time. Others come and go as their bodies do (`around`). What a road changes at once, lanes
and widths at a border of sections, is what the vehicle has around it: the mean over the way that it drives within a
second or two.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.base import vehicle_classes
from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.vehicle_classes import class_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.global_actions import Environment, EnvironmentAction, Weather
from xosc_lateral.world.surroundings import around

STEERING_DURATION = 1.0
"""Standard deviation of the kernel over which roads are seen and by which drivers respond: steering takes a second or
two. [s]"""

ROWS_TOGETHER = 100_000
"""Rows of all others that are looked at together: as many as stay in a processor's cache. [-]"""

TRUCKS = frozenset(category for category in VehicleCategory if class_of(category) in vehicle_classes.TRUCKS)


class Surroundings:
    """What the vehicles of a motion see; what is the same for all of them is found once."""

    def __init__(self, motion: NominalMotion, network: RoadNetwork) -> None:
        self.motion, self.network = motion, network
        self._latest: tuple[tuple[int, int], _Traffic] | None = None

    def context(self, index: int, grid: IntArray) -> dict[str, FloatArray]:
        """Context of the `index`-th vehicle on some of its rows, shape (n,) each.

        NaN where there is none (no lane to that side; off the road), infinite where a lane has nobody within reach.
        Weather that the scenario does not state is absent.
        """
        entity = self.motion.entities[index]
        road = _road(entity, self.network, grid)
        step = float(entity.time[grid[1]] - entity.time[grid[0]]) if len(grid) > 1 else STEERING_DURATION
        beside = _neighbours(self, index, grid, _lanes_there(road, step))
        road = {name: _around(values, step) for name, values in road.items()}
        return _own_motion(entity, grid) | road | beside | _weather(self.environments, entity, grid)

    def traffic(self, first: int, every: int) -> _Traffic:
        """On every so many rows of the run; the latest is kept, since vehicles ask for it one after another."""
        if self._latest is None or self._latest[0] != (first, every):
            self._latest = (first, every), _traffic(self.motion, self.network, first, every)
        return self._latest[1]

    @cached_property
    def in_sight(self) -> list[tuple[slice, list[IntArray]]]:
        """See `_in_sight`."""
        return _in_sight(self.motion)

    @cached_property
    def environments(self) -> list[tuple[float, Environment]]:
        """Environments that actions set, and when. [s]"""
        actions = ((played.start, played.action.content) for played in self.motion.actions)
        return [(start, content.environment) for start, content in actions if isinstance(content, EnvironmentAction)]


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
    # Against the lane's traffic all is seen the other way round.
    along = entity.way(rows).astype(np.float64)
    values = road_columns(network, entity.road[rows], entity.lane[rows], entity.s[rows], entity.offset[rows], along)
    return {name: spread_out(part, on) for name, part in values.items()}


def spread_out(values: FloatArray, where: BoolArray) -> FloatArray:
    """As many values as there are rows `where` they belong, NaN in the others; shape of `where`."""
    known = np.full(len(where), np.nan)
    known[where] = values
    return known


def road_columns(
    network: RoadNetwork, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike, along: FloatArray
) -> dict[str, FloatArray]:
    """Context columns of places on lanes, shape (n,) each; `along`: 1, or -1 against traffic."""
    lane_index, lane_count = network.lane_index(road, lane, s)
    crossfall, grade = network.lean(road, lane, s)
    lane_seen = np.where(along > 0, lane_index, lane_count - 1 - lane_index)
    return {
        "curvature": along * network.lane_curvature(road, lane, s, offset),
        "lane_width": network.lane_width(road, lane, s),
        "lane_index": np.where(lane_index >= 0, lane_seen, np.nan).astype(np.float64),
        "lane_count": lane_count.astype(np.float64),
        "crossfall": along * crossfall,
        "grade": along * grade,
    }


def _around(values: FloatArray, step: float) -> FloatArray:
    """Mean of a road's column over the way around each row, where the column is known, shape (n,); `step` in [s]."""
    known = np.isfinite(values)
    if not known.any() or np.ptp(values[known]) == 0.0:
        return values
    half = round(4.0 * STEERING_DURATION / step)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) * step / STEERING_DURATION) ** 2)
    parts = (np.pad(part, half) for part in (np.where(known, values, 0.0), known * 1.0))
    total, weight = (np.convolve(part, kernel, "valid") for part in parts)
    return np.where(known, total / np.where(known, weight, 1.0), np.nan)


def _neighbours(
    surroundings: Surroundings, index: int, grid: IntArray, lanes: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    motion, network = surroundings.motion, surroundings.network
    observer = motion.entities[index]
    steps = np.diff(grid)
    every = int(steps[0]) if len(steps) and (steps == steps[0]).all() else 1
    traffic = surroundings.traffic(int(grid[0]) % every, every)
    columns = grid // every
    nearby = around.NearestVehicles.with_no_one(len(grid))
    groups = _own_lane_groups(observer, network, grid, traffic.direction[index, columns])
    width = _own_lane_width(observer, network, grid)
    extent, box = traffic.extent, observer.entity.bounding_box
    far = (
        around.SIGHT_DISTANCE
        + 0.5 * box.length
        + abs(box.center_x)
        + np.max(0.5 * extent.length + np.abs(extent.center_x))
        + 1.0
    )
    for stretch, in_sight in surroundings.in_sight:
        numbers = np.array([k for k in in_sight[index] if motion.entities[k].entity.is_vehicle], dtype=np.int64)
        inside = [slice(*np.searchsorted(grid[rows], (stretch.start, stretch.stop))) for rows, _, _ in groups]
        together = max(1, ROWS_TOGETHER // max(1, *(part.stop - part.start for part in inside), 1))
        for begin in range(0, len(numbers), together):
            others = numbers[begin : begin + together]
            for part, (of_group, own_u, path) in zip(inside, groups, strict=True):
                members = of_group[part]
                if not len(members):
                    continue
                u, offset = (np.tile(values, len(others)) for values in (own_u[part], observer.offset[grid[members]]))
                road, s, t, direction = traffic.of(others, columns[members])
                seen = around.see_along(path, u, offset, road, s, t, direction, network.lane_centre_t)
                k = np.flatnonzero(np.abs(seen.ahead) <= far)
                seen = around.OtherVehicles(seen.ahead[k], seen.left[k], seen.oncoming[k])
                number, rows = others[k // len(members)], members[k % len(members)]
                gap = around.free_space(seen, box, around.Extent(*(values[number] for values in extent)))
                nearby.add(rows, seen, gap, width[rows], traffic.width[number], traffic.is_truck[number])
    return nearby.columns(lanes)


class _Traffic(NamedTuple):
    """Everybody on some rows of the run, shape (entities, n): road, s and t [m], way along s (0: on no lane)."""

    road: IntArray
    s: FloatArray
    t: FloatArray
    direction: NDArray[np.int8]
    extent: around.Extent
    width: FloatArray
    """Of each, shape (entities,). [m]"""
    is_truck: BoolArray

    def of(self, others: IntArray, columns: IntArray) -> Iterator[NDArray[Any]]:
        """What `see_along` asks of some of them on some of the rows, one entity after the other."""
        in_a_row = columns[-1] - columns[0] + 1 == len(columns)
        for values in (self.road, self.s, self.t, self.direction):
            part = values[:, columns[0] : columns[-1] + 1][others] if in_a_row else values[np.ix_(others, columns)]
            yield part.ravel()


def _traffic(motion: NominalMotion, network: RoadNetwork, first: int, every: int) -> _Traffic:
    """On every so many rows of the run."""
    names = ("road", "lane", "s", "offset", "activity", "heading_relative")
    count, n = len(motion.entities), len(motion.entities[0].time[first::every])
    tables = [np.empty((count, n), kind) for kind in (np.int32, np.float64, np.float64, np.int8)]
    together = max(1, ROWS_TOGETHER // max(n, 1))
    for begin in range(0, count, together):
        entities = motion.entities[begin : begin + together]
        stacked = (np.concatenate([getattr(one, name)[first::every] for one in entities]) for name in names)
        road, lane, s, offset, activity, heading = stacked
        present = ((activity & Activity.ACTIVE) != 0) & (road >= 0) & (lane != 0)
        t = np.full(len(s), np.nan)
        t[present] = network.offset_to_t(road[present], lane[present], s[present], offset[present])
        direction = np.zeros(len(s), dtype=np.int8)
        direction[present] = network.travel_directions(road[present], lane[present])
        direction = np.where(np.cos(heading) < 0.0, -direction, direction)
        for table, values in zip(tables, (road, s, t, direction), strict=True):
            table[begin : begin + together] = values.reshape(-1, n)
    boxes = [one.entity.bounding_box for one in motion.entities]
    length, centre, width = (np.array([getattr(b, name) for b in boxes]) for name in ("length", "center_x", "width"))
    is_truck = np.array([one.entity.vehicle_category in TRUCKS for one in motion.entities])
    return _Traffic._make([*tables, around.Extent(length, centre), width, is_truck])


def _own_lane_width(observer: EntityMotion, network: RoadNetwork, grid: IntArray) -> FloatArray:
    """Of the lane, at least the vehicle's own, shape (n,). [m]"""
    width = np.full(len(grid), observer.entity.bounding_box.width)
    on = (observer.road[grid] >= 0) & (observer.lane[grid] != 0)
    rows = grid[on]
    width[on] = np.maximum(width[on], network.lane_width(observer.road[rows], observer.lane[rows], observer.s[rows]))
    return np.asarray(np.maximum(width, 0.1))


def _lanes_there(road: Mapping[str, FloatArray], step: float) -> dict[str, FloatArray]:
    """How far there is a lane on each side of the way around, shape (n,) each. [-]"""
    shares = {side: _around(one.astype(np.float64), step) for side, one in lanes_beside(road).items()}
    return {
        side: np.clip((share - _NEGLIGIBLE_SHARE) / (1.0 - 2.0 * _NEGLIGIBLE_SHARE), 0.0, 1.0)
        for side, share in shares.items()
    }


def lanes_beside(road: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
    """Whether there is a lane on each side, shape (n,) each."""
    index, count = road["lane_index"], road["lane_count"]
    return {"lead": index >= 0, "right": index > 0, "left": index < count - 1}


_NEGLIGIBLE_SHARE = 1e-3
"""A share of a lane that is none. [-]"""


def _in_sight(motion: NominalMotion) -> list[tuple[slice, list[IntArray]]]:
    """For rows of the run, and every entity, those near in space, whom alone it may see along its lane, in order."""

    def where_active(axis: str) -> Iterator[FloatArray]:
        for entity in motion.entities:
            yield np.where((entity.activity & Activity.ACTIVE) != 0, getattr(entity, axis), np.nan)

    parts: list[tuple[slice, list[IntArray]]] = []
    if len(motion.entities) < 2:
        return parts
    for rows, pairs in around.stretches_within(where_active("x"), where_active("y"), around.IN_SIGHT, blocks=64):
        both = np.array([*pairs, *(pair[::-1] for pair in pairs)], dtype=np.int64)
        both = both[np.lexsort((both[:, 1], both[:, 0]))]
        ends = np.searchsorted(both[:, 0], np.arange(1, len(motion.entities)))
        parts.append((rows, np.split(both[:, 1].copy(), ends)))
    return parts


def _own_lane_groups(
    entity: EntityMotion, network: RoadNetwork, grid: IntArray, direction: NDArray[np.int8]
) -> list[tuple[IntArray, FloatArray, list[around.LaneStretch]]]:
    """Rows of the grid that share one lane path: positions in the grid, own u there, and the path."""
    groups: dict[tuple[int, int, float, int], list[IntArray]] = {}
    on = np.flatnonzero(direction)
    road, lane, s = entity.road[grid[on]], entity.lane[grid[on]], entity.s[grid[on]]
    keys = np.stack([road, lane, network.section_numbers(road, s), direction[on]])
    for part in np.split(np.arange(len(on)), np.flatnonzero((np.diff(keys) != 0).any(axis=0)) + 1):
        if len(part):
            k = int(part[0])
            start, _ = network.section_at(int(road[k]), float(s[k]))
            groups.setdefault((int(road[k]), int(lane[k]), start, int(keys[3, k])), []).append(on[part])
    result = []
    for (number, lane_id, _, forward), members in groups.items():
        rows = np.concatenate(members)
        along = entity.s[grid[rows]]
        path = around.lane_path(network, number, lane_id, float(along[0]), forward)
        result.append((rows, path[0].sign * (along - along[0]), path))
    return result


def _weather(
    environments: list[tuple[float, Environment]], entity: EntityMotion, grid: IntArray
) -> dict[str, FloatArray]:
    time = entity.time[grid]
    context: dict[str, FloatArray] = {}
    for start, environment in environments:
        since = time >= start - 1e-9
        for name, values in _stated(environment, time, start, entity.heading[grid]).items():
            context.setdefault(name, np.full(len(grid), np.nan))[since] = values[since]
    return context


def _stated(environment: Environment, time: FloatArray, start: float, heading: FloatArray) -> dict[str, FloatArray]:
    """Context columns of what one environment states, shape (n,) each."""
    values: dict[str, FloatArray] = {}
    weather, clock = environment.weather or Weather(), environment.time_of_day
    if clock is not None:
        seconds = clock.date_time.hour * 3600.0 + clock.date_time.minute * 60.0 + clock.date_time.second
        running = time - start if clock.animation else np.zeros(len(time))
        values["time_of_day"] = (seconds + running) / 3600.0 % 24.0
    rain = {"dry": 0.0, "rain": weather.precipitation_intensity}.get(weather.precipitation_type or "")
    constant = {"friction": environment.friction_scale_factor, "illuminance": weather.illuminance, "rain": rain}
    values |= {name: np.full(len(time), value) for name, value in constant.items() if value is not None}
    if weather.wind_speed is not None and weather.wind_direction is not None:
        values["wind_speed"] = np.full(len(time), weather.wind_speed)
        # 90 deg blows to the left of travel; the standard's direction is where the wind blows to, against world x
        values["wind_direction"] = np.degrees(weather.wind_direction - heading) % 360.0
    return values
