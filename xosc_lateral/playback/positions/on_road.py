"""Placements from road coordinates: what lane, road and route positions have in common."""

from __future__ import annotations

from math import pi

from msgspec.structs import replace

from xosc_lateral.errors import PlaybackError
from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.orientation import heading_of, is_absolute, tilted
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.scenario import Place
from xosc_lateral.scenario.position import Orientation


def road_index(simulation: Simulation, road_id: str, place: Place) -> int:
    """Index of a road; raises `PlaybackError` at `place` if it is not there."""
    if road_id not in simulation.network.road_ids:
        known = ", ".join(simulation.network.road_ids[:8]) or "none"
        raise _error(f"there is no road '{road_id}' (roads: {known})", place)
    return simulation.network.index_of(road_id)


def lane_placement(
    simulation: Simulation,
    road: int,
    lane: int,
    s: float,
    offset_t: float,
    orientation: Orientation | None,
    place: Place,
    *,
    along_lane: bool = True,
) -> Placement:
    """A place on a lane. Relative headings count from the lane's direction of travel, or else from s. [m], [rad]"""
    network = simulation.network
    length = network.roads[road].length
    if not -_SLACK <= s <= length + _SLACK:
        simulation.note(f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", place)
    s = min(max(s, 0.0), length)
    if not network.has_lane_at(road, lane, s):
        there = ", ".join(str(info.id) for info in network.lanes_at(road, s))
        raise _error(f"road '{network.road_ids[road]}' has no lane {lane} at s = {s:g} m (lanes: {there})", place)
    against = along_lane and network.travel_direction(road, lane) < 0
    relative = _relative(simulation, road, lane, s, orientation, against=against)
    return _tilt(Placement(road, lane, s, offset_t, relative), orientation, simulation)


def road_placement(
    simulation: Simulation, road: int, s: float, t: float, orientation: Orientation | None, place: Place
) -> Placement:
    """A place beside the reference line; relative headings count from s. [m], [rad]"""
    network = simulation.network
    length = network.roads[road].length
    if not -_SLACK <= s <= length + _SLACK:
        simulation.note(f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", place)
    s = min(max(s, 0.0), length)
    found = network.lane_at(road, s, t)
    offset_t = t - network.lane_state_at(road, found.lane, s).centre_t
    relative = _relative(simulation, road, found.lane, s, orientation, against=False)
    return _tilt(Placement(road, found.lane, s, offset_t, relative), orientation, simulation)


def _tilt(place: Placement, orientation: Orientation | None, simulation: Simulation) -> Placement:
    """Pitch and roll that are given hold until the entity drives on."""
    if orientation is None or not (orientation.p or orientation.r):
        return place
    scout = EntityState(simulation.entities[0].entity, simulation.network)
    scout.put(place)
    pitch, roll = tilted(orientation, scout.pose.pitch, scout.pose.roll, simulation)
    return replace(place, pose=scout.pose._replace(pitch=pitch, roll=roll))


def _relative(
    simulation: Simulation, road: int, lane: int, s: float, orientation: Orientation | None, *, against: bool
) -> float:
    heading = heading_of(orientation)
    if not is_absolute(orientation, simulation):
        return heading + (pi if against else 0.0)
    lane_heading = simulation.network.pose_at(road, lane, s).heading
    return heading - lane_heading + (0.0 if simulation.network.travel_direction(road, lane) > 0 else pi)


_SLACK = 0.01
"""Roads are written a little shorter or longer than they are. [m]"""


def _error(what: str, place: Place) -> PlaybackError:
    return PlaybackError(what, path=place.path, line=place.line, element=place.element)
