"""Read OpenDRIVE 1.1-1.8 roads, leniently, into a `RoadNetwork`."""

from __future__ import annotations

from os import PathLike

from xosc_lateral.road.network import RoadNetwork


def read_opendrive(path: str | PathLike[str]) -> RoadNetwork:
    """Read one ``.xodr``; raises `FormatError` with file, line, element and value when it can't be understood."""
    raise NotImplementedError
