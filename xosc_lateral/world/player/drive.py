"""Moving along lanes: the default driver, what lane changes and lane offsets need of it, and trailers behind it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import atan2, cos, hypot, inf, nan, pi, sin

from xosc_lateral.world.player.state import NO_ROAD, EntityState, free
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import LaneLink, wrap

_LEAST_SHRINK = 1e-3
"""Beyond this share of the radius, the centre of a curve is so near that lengths beside the line say nothing. [-]"""


def drive(state: EntityState, distance: float) -> None:
    """Let the default driver move an entity, `distance` on its own track; it stops where there is no road. [m]"""
    state.follow_lane()
    if state.road == NO_ROAD:
        state.set_speed(0.0)
        return
    move_along_lane(state, distance)
    state.speed_taken = True


def move_along_lane(state: EntityState, distance: float) -> None:
    """Move an entity along its lane as far as it goes, lateral offset and relative heading kept.

    `distance` is on its own track, negative backwards; the way along the reference line follows from the curvature at
    the START of the step (explicit Euler, as the reference player does it). [m]
    """
    travel(state, 1 if state.is_forward else -1, along_reference(state, state.s, distance))


def halt_at_road_end(state: EntityState, step: float) -> None:
    """An entity that has not moved at a road's end in the frame before stops, whoever drives it; `step` in [s]."""
    if state.free_pose is not None:
        state.last_place, state.stuck = None, False
        return
    before, here = state.last_place, (state.road, state.s, state.offset_t)
    state.last_place = here
    if not state.at_road_end:
        state.stuck = False
        return
    if state.stuck:
        state.set_speed(0.0)
    moved = inf if before is None or before[0] != here[0] else abs(here[1] - before[1]) + abs(here[2] - before[2])
    state.stuck = moved < EPSILON * step


def along_reference(state: EntityState, s: float, distance: float) -> float:
    """Length along the reference line of an entity's way beside it, from `s` on. [m]"""
    curvature = state.network.curvature_at(state.road, s)
    if abs(curvature) < EPSILON:
        return distance
    t = state.network.lane_state_at(state.road, state.lane, s).centre_t + state.offset_t
    return beside_line(curvature, t, distance)


def beside_line(curvature: float, t: float, distance: float) -> float:
    """Length along a line of a way beside it, where that line has a curvature [1/m]. [m]"""
    if abs(curvature) < EPSILON:
        return distance
    shrink = 1.0 - curvature * t
    return distance / shrink if shrink > _LEAST_SHRINK else distance


def travel(state: EntityState, way: int, distance: float) -> None:
    """Move along s: `way` +1 or -1 tells the direction of a positive distance. [m]"""
    if distance < 0.0:
        way, distance = -way, -distance
    s = state.s + way * distance
    start, end = state.section
    if start < s < end:
        state.s = s
        state._pose = None
        state.at_road_end = False
        return
    links_passed = 0
    while True:
        moved = state.network.advance(
            state.road, state.lane, state.s, distance, direction=way, choose=lambda options: _choose(state, options)
        )
        if moved.direction != way:
            _turn_round(state)
        state.move_to(moved.road, moved.lane, moved.s, state.offset_t)
        way, distance = moved.direction, moved.remaining
        links_passed += 1
        if distance <= 0.0 or links_passed > _MOST_GAPS:
            break
        onward = _bridge_gap(state, way)
        if onward is None:
            break
        way = onward
    _leave_narrow_lane(state)
    _note_surroundings(state, way, blocked=distance > 0.0)


_MOST_GAPS = 8
"""Lanes without a link that are bridged in one step, at most."""


def _choose(state: EntityState, options: Sequence[LaneLink]) -> LaneLink:
    """At a junction: along the route; where that says nothing, the first way on, as in the reference player.

    Without a route straight on, seen from the direction in which the lane is driven: who drives against it takes the
    way that turns most. The standard does not say; the reference player does it so.
    """
    network, first = state.network, options[0]
    if state.route is not None:
        return state.route.choose(state.road, options) or first
    if first.direction != network.travel_direction(first.road, first.lane):
        return network.most_turning(options)
    return network.straightest(options)


def _turn_round(state: EntityState) -> None:
    """Onto a road whose s runs the other way."""
    state.offset_t = -state.offset_t
    state.turn(state.relative_heading + pi)


def _bridge_gap(state: EntityState, way: int) -> int | None:
    """A lane ends without a link: go on in the nearest lane beyond; the new way along s, or None at a true end.

    Between sections of a road that is the one nearest to the middle of the old lane, and the offset is kept; between
    roads it is the one nearest to the entity, which goes to its middle (both as the reference player does it).
    """
    network, road = state.network, state.network.roads[state.road]
    number = road.section_number(state.s)
    leaves = number == (len(road.sections) - 1 if way > 0 else 0)
    t = state.t if leaves else state.t - state.offset_t
    onto = network.beyond_end(state.road, number, state.lane, way, t, state.kept_types())
    if onto is None:
        return None
    if onto.direction != way:
        _turn_round(state)
    state.move_to(onto.road, onto.lane, onto.s, 0.0 if leaves else state.offset_t)
    return onto.direction


def _leave_narrow_lane(state: EntityState) -> None:
    """A lane that has closed is left for the middle of the nearest open one on the same side of the road."""
    network = state.network
    if state.lane == 0 or network.lane_state_at(state.road, state.lane, state.s).width >= EPSILON:
        return
    lane = network.lane_at(
        state.road,
        state.s,
        state.t,
        lane_types=state.kept_types(),
        direction=network.travel_direction(state.road, state.lane),
    ).lane
    if lane and network.lane_state_at(state.road, lane, state.s).width >= EPSILON:
        state.move_to(state.road, lane, state.s, 0.0)


def _note_surroundings(state: EntityState, way: int, *, blocked: bool) -> None:
    """Remember how far the lane id holds (not at all while the lane may close), and whether the road ends here."""
    network = state.network
    road = network.roads[state.road]
    start, end = network.section_at(state.road, state.s)
    lane = road.section_at(state.s).by_id.get(state.lane)
    closes = (
        state.lane == 0 or lane is None or any(lane.state_at(s).width < EPSILON for s in (*lane.starts, start, end))
    )
    state.section = (0.0, -1.0) if closes else (start, end)
    dead_end = (state.s <= EPSILON and road.predecessor is None) or (
        state.s >= road.length - EPSILON and road.successor is None
    )
    state.at_road_end = blocked or dead_end


# ---- trailers ----
# Derived here: the line from hitch to coupler keeps its direction towards where the trailer was (a tractrix in small
# steps); its length is the drawbar's.
_TRACTOR_HITCH = -1.0
_TRAILER_COUPLER = 2.0
"""Where a file says nothing of hitch and coupler: [m] ahead of the reference point."""


def connect(tow: EntityState, trailer: EntityState) -> None:
    """Hitch a trailer; whatever pulled it before lets go."""
    if trailer.tow is not None:
        disconnect(trailer.tow)
    tow.trailer, trailer.tow = trailer, tow


def disconnect(tow: EntityState) -> None:
    """Let the trailer go."""
    if tow.trailer is not None:
        tow.trailer.tow = None
        tow.trailer = None


def drawn_by(front: EntityState) -> Iterator[tuple[EntityState, EntityState]]:
    """All that hangs on a vehicle: each with what pulls it, from the front."""
    while front.trailer is not None:
        yield front, front.trailer
        front = front.trailer


def align_trailers(front: EntityState) -> None:
    """Put all trailers straight behind their tractor."""
    for tow, trailer in drawn_by(front):
        pose = tow.plane
        reach = _hitch(tow) - _coupler(trailer)
        trailer.put_in_world(free(pose.x + reach * cos(pose.heading), pose.y + reach * sin(pose.heading), pose.heading))
        trailer.set_speed(front.speed)


def pull_trailers(entities: Iterable[EntityState]) -> None:
    """Draw every trailer to where its hitch has gone: it turns so that its coupler is there."""
    for front in entities:
        if front.tow is None:
            for tow, trailer in drawn_by(front):
                _pull(tow, trailer)
                trailer.set_speed(tow.speed)


def _pull(tow: EntityState, trailer: EntityState) -> None:
    pose, pulled = tow.plane, trailer.plane
    hitch_x = pose.x + _hitch(tow) * cos(pose.heading)
    hitch_y = pose.y + _hitch(tow) * sin(pose.heading)
    dx, dy = pulled.x - hitch_x, pulled.y - hitch_y
    length = hypot(dx, dy)
    if length < 1e-9:
        dx, dy, length = -cos(pulled.heading), -sin(pulled.heading), 1.0
    reach = _coupler(trailer) / length
    heading = wrap(atan2(dy, dx) + pi)
    trailer.put_in_world(free(hitch_x + reach * dx, hitch_y + reach * dy, heading, nan))


def _hitch(state: EntityState) -> float:
    hitch = state.entity.hitch_x
    return _TRACTOR_HITCH if hitch is None else hitch


def _coupler(state: EntityState) -> float:
    coupler = state.entity.coupler_x
    return _TRAILER_COUPLER if coupler is None else coupler
