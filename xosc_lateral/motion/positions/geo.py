"""GeoPosition: latitude and longitude, by the road network's projection."""

from __future__ import annotations

from math import nan

from xosc_lateral.errors import PlaybackError
from xosc_lateral.motion.positions.orientation import heading_of
from xosc_lateral.motion.positions.projection import ProjectionError, project
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import Placement, free, locate
from xosc_lateral.scenario.position import GeoPosition


def resolve(position: GeoPosition, run: Run) -> Placement:
    """Needs the road network's geoReference."""
    place = position.place
    try:
        x, y = project(run.network.geo_reference, position.latitude, position.longitude)
    except ProjectionError as error:
        raise PlaybackError(str(error), path=place.path, line=place.line, element=place.element) from error
    z = nan if position.altitude is None else position.altitude
    return locate(run.network, free(x, y, heading_of(position.orientation), z))
