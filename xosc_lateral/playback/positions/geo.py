"""GeoPosition: latitude and longitude, by the road network's projection."""

from __future__ import annotations

from math import nan

from xosc_lateral.errors import PlaybackError
from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.orientation import heading_of
from xosc_lateral.playback.positions.projection import ProjectionError, project
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.scenario.position import GeoPosition


def resolve(position: GeoPosition, simulation: Simulation) -> Placement:
    """Needs the road network's geoReference."""
    place = position.place
    try:
        x, y = project(simulation.network.geo_reference, position.latitude, position.longitude)
    except ProjectionError as error:
        raise PlaybackError(str(error), path=place.path, line=place.line, element=place.element) from error
    offset = simulation.network.header_offset
    x, y = offset.undo(x, y)
    z = nan if position.altitude is None else position.altitude - offset.z
    return locate(simulation.network, free(x, y, heading_of(position.orientation) - offset.heading, z))
