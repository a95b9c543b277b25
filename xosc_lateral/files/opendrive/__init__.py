"""Read OpenDRIVE 1.1-1.8, leniently: what is odd but clear is repaired and noted, what is unclear is refused."""

from __future__ import annotations

from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive

__all__ = ["parse_opendrive", "read_opendrive"]
