"""What can hardly be meant, looked for after a run: lanes, routes, places and jumps that no file would ask for.

It asks nothing of the player: it looks at the motion alone, so that what goes wrong there shows here.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray, Int32Array, blocks, rows_where
from xosc_lateral.base.note import Note
from xosc_lateral.world.motion.gaps import box_distance, corners
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, FollowedRoute, NominalMotion
from xosc_lateral.world.player.distances import HEIGHT_APART
from xosc_lateral.world.player.drive import beside_line
from xosc_lateral.world.road.geometry import ParamCubic
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.private_actions import LongitudinalDistanceAction

LEAP_DISTANCE = 0.3
"""Further than who drives and slides aside at `MAXIMUM_LATERAL_SPEED`, and aside by this much more: a leap. [m]"""

ALONG_CUBIC, CUBIC_STEP = 0.05, 0.1
"""By how much somebody is elsewhere in esmini, seen so often. [m], [s]"""

MAXIMUM_LATERAL_SPEED = 10.0
"""No lateral action is faster. [m/s]"""

_PRESENT = np.uint8(Activity.ACTIVE)
_LED = np.uint8(Activity.TRAJECTORY | Activity.STEERED)
"""Along a trajectory, or by a controller, whose way is not decided here."""
_GUIDED = _LED | np.uint8(Activity.LATERAL | Activity.TELEPORTED)


def doubts_about(motion: NominalMotion, network: RoadNetwork, trailers: dict[str, str]) -> tuple[Note, ...]:
    """Notes with file, line, entity and time; `trailers`: who is pulled from the start, and by whom."""
    notes: list[Note] = []
    is_cubic = np.array([any(isinstance(one, ParamCubic) for one in road.elements) for road in network.roads] + [False])
    for entity in motion.entities:
        if entity.name not in trailers:
            notes += _jumps(entity, motion, network)
        if entity.entity.is_vehicle:
            notes += _lanes_for_nobody(entity, network)
        notes += _along_cubics(entity, motion.step, network, is_cubic)
    for route in motion.routes:
        notes += _off_route(route, next(each for each in motion.entities if each.name == route.entity), motion, network)
    notes += _overlaps(motion, trailers)
    return tuple(notes)


def _jumps(entity: EntityMotion, motion: NominalMotion, network: RoadNetwork) -> Iterator[Note]:
    """The first jump that nobody asked for, what made it, and how many there are."""
    jumps = leaps(entity)
    if not jumps:
        return
    (time, length), more = jumps[0], f" ({len(jumps)} times in all)" if len(jumps) > 1 else ""
    row = int(np.argmin(np.abs(entity.time - time)))
    before, here = (int(road) for road in entity.road[[row - 1, row]])
    at_once = [
        one
        for one in motion.actions
        if one.actor == entity.name
        and isinstance(one.action.content, LongitudinalDistanceAction)
        and one.start <= time and (one.end is None or one.end > time - 2.0 * motion.step)
    ]  # fmt: skip
    place, why = entity.entity.place, "the lane that it follows ends, or its road has a gap"
    if at_once:
        place = at_once[0].action.place
        why = "a LongitudinalDistanceAction without dynamic constraints puts it at its distance at once"
    elif before != here and min(before, here) >= 0:
        ids = network.road_ids
        why = f"road '{ids[before]}' is linked to road '{ids[here]}', which does not begin where it ends"
    what = f"'{entity.name}' jumps {length:.1f} m at {time:.2f} s{more}, further than its speed explains: {why}"
    yield place.note(what, is_warning=True)


def leaps(motion: EntityMotion) -> list[tuple[float, float]]:
    """Times [s] and lengths [m] of jumps that nobody asked for: a followed lane closes, roads don't meet."""

    def moved(around: slice) -> FloatArray:
        return np.hypot(np.diff(motion.x[around]), np.diff(motion.y[around]))

    def leaps_there(rows: slice) -> BoolArray:
        around = slice(rows.start - 1, rows.stop)
        step, speed, activity = np.diff(motion.time[around]), np.abs(motion.speed[around]), motion.activity[around]
        active = (activity & Activity.ACTIVE) != 0
        unasked = (activity[1:] & (Activity.TELEPORTED | Activity.STEERED)) == 0
        whole = active[1:] & active[:-1] & unasked
        driven = np.maximum(speed[1:], speed[:-1]) * step
        aside = LEAP_DISTANCE + MAXIMUM_LATERAL_SPEED * step
        return np.asarray(whole & (moved(around) > np.hypot(driven, aside)))

    leaping = rows_where(len(motion.time), leaps_there, 1)
    return [(float(motion.time[k]), float(moved(slice(k - 1, k + 1))[0])) for k in leaping]


def _lanes_for_nobody(entity: EntityMotion, network: RoadNetwork) -> Iterator[Note]:
    """A vehicle comes from a lane for vehicles onto another kind, and nobody has steered it there."""
    for rows in blocks(len(entity.time), 1):
        both = slice(rows.start - 1, rows.stop)
        road, lane = entity.road[both], entity.lane[both]
        changes = np.flatnonzero((np.diff(lane) != 0) | (np.diff(road) != 0)) + 1
        for k in changes.tolist():
            before, here = (_type_at(entity, network, rows.start - 1 + row) for row in (k - 1, k))
            guided = (entity.activity[rows.start - 1 + k] & _GUIDED) != 0
            if before in DRIVING and here and here not in DRIVING and not guided:
                where = f"lane {lane[k]} of road '{network.road_ids[road[k]]}', of type {here}"
                what = f"'{entity.name}' comes onto {where}, at {entity.time[rows.start - 1 + k]:.2f} s by itself"
                yield entity.entity.place.note(what, is_warning=True)
                return


def _along_cubics(entity: EntityMotion, step: float, network: RoadNetwork, is_cubic: BoolArray) -> Iterator[Note]:
    """Where esmini has it elsewhere: it takes a cubic's parameter for the share of the way; `is_cubic`: of roads."""
    every = max(1, round(CUBIC_STEP / step))
    drives = (entity.activity & (Activity.ACTIVE | Activity.TRAJECTORY)) == Activity.ACTIVE
    rows = np.flatnonzero(drives & is_cubic[entity.road] & (entity.lane != 0))[::every]
    places = entity.road[rows], entity.lane[rows], entity.s[rows]
    t, further = network.offset_to_t(*places, entity.offset[rows]), np.zeros(len(rows) + 1)
    for k, (road, lane, s) in enumerate(zip(*(column.tolist() for column in places), strict=True)):
        _, _, element, begin, _ = network.roads[road].stretch_of(lane, s)
        if isinstance(element, ParamCubic):
            curvatures, way = (element.curvature_in_esmini, element.curvature_at), entity.speed[rows[k]] * every * step
            theirs, ours = (beside_line(curvature(s - begin), t[k], way) for curvature in curvatures)
            further[k] = theirs - ours
    away = np.abs(np.cumsum(further))
    if away.max() > ALONG_CUBIC:
        first = entity.time[rows[int(np.argmax(away > ALONG_CUBIC))]]
        what = (
            f"'{entity.name}' is up to {away.max():.2f} m elsewhere along its road in esmini, from {first:.2f} s on: "
            "esmini takes the curvature of a parametric cubic at another place"
        )
        yield entity.entity.place.note(what, entity=entity.name)


def _type_at(entity: EntityMotion, network: RoadNetwork, row: int) -> str:
    """Of its lane; empty on none."""
    road, lane = int(entity.road[row]), int(entity.lane[row])
    if road < 0 or lane == 0:
        return ""
    described = network.roads[road].section_at(float(entity.s[row])).by_id.get(lane)
    return "" if described is None else described.type


def _off_route(
    route: FollowedRoute, entity: EntityMotion, motion: NominalMotion, network: RoadNetwork
) -> Iterator[Note]:
    """Whether an entity leaves its route before its end, or passes beside a waypoint; until it has another route."""
    later = (other.time for other in motion.routes if other.entity == route.entity and other.time > route.time)
    begin, end = np.searchsorted(entity.time, (route.time, min(later, default=inf)))
    roads = [step.road for step in route.steps]
    at, k = -1, int(begin)
    for first in _changes(entity.road[begin:end]).tolist():
        k = int(begin) + first
        road = int(entity.road[k])
        if road < 0 or not entity.activity[k] & _PRESENT or road in roads[at : at + 1]:
            continue
        if entity.activity[k] & np.uint8(Activity.TELEPORTED):
            at = roads.index(road) if road in roads else len(roads)  # put there by the file
        elif road in roads[at + 1 :]:
            at += 1 + roads[at + 1 :].index(road)
        elif network.roads[road].junction is None and 0 <= at < len(roads) - 1 and not entity.activity[k] & _LED:
            where = f"on road '{network.road_ids[road]}', at {entity.time[k]:.2f} s"
            yield route.place.note(f"'{entity.name}' leaves its route: it is {where}", is_warning=True)
            return
    for number, (road, lane, s) in enumerate(route.stops, start=1):
        on = np.flatnonzero(entity.road[begin:end] == road) + int(begin)
        side = np.sign(entity.s[on] - s)
        over = np.flatnonzero((np.diff(side) != 0) & (np.diff(on) == 1))
        over = on[over + 1]
        led = (entity.lane[over] == lane) | ((entity.activity[over] & _GUIDED) != 0)
        if len(over) and lane != 0 and not led.any():
            row = int(over[0])
            beside = f"in lane {entity.lane[row]} of road '{network.road_ids[road]}' instead of {lane}"
            what = f"'{entity.name}' passes waypoint {number} of its route {beside}, at {entity.time[row]:.2f} s"
            yield route.place.note(what, is_warning=True)


def _changes(values: Int32Array) -> IndexArray:
    """Rows in which an integer column is not as in the row before, the first among them."""
    return np.flatnonzero(np.diff(values, prepend=values[:1] - 1))


def _overlaps(motion: NominalMotion, trailers: dict[str, str]) -> Iterator[Note]:
    """Whose boxes touch when one of them appears."""
    starts = [int(np.argmax((each.activity & _PRESENT) != 0)) for each in motion.entities]
    for i, (entity, row) in enumerate(zip(motion.entities, starts, strict=True)):
        for j, other in enumerate(motion.entities):
            pulls = entity.name in trailers or other.name in trailers
            appears_later = starts[j] > row or (starts[j] == row and j >= i)
            if pulls or appears_later or not (entity.activity[row] & other.activity[row] & _PRESENT):
                continue
            if _touch(entity, other, row):
                what = f"'{entity.name}' appears in '{other.name}': their boxes overlap at {entity.time[row]:.2f} s"
                yield entity.entity.place.note(what, is_warning=True)


def _touch(entity: EntityMotion, other: EntityMotion, row: int) -> bool:
    """Whether boxes overlap in the plane, on the same level."""
    reach = sum(np.hypot(each.box.length, each.box.width) + abs(each.box.center_x) for each in (entity, other))
    away = np.hypot(other.x[row] - entity.x[row], other.y[row] - entity.y[row])
    if away > reach or abs(other.z[row] - entity.z[row]) > HEIGHT_APART:
        return False
    a, b = (corners([(each, np.array([row]))]) for each in (entity, other))
    return not box_distance(a, b)[0]
