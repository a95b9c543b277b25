"""Orientations: absolute, or relative to a road or an entity."""

from __future__ import annotations

from math import nan

from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.road import Pose
from xosc_lateral.scenario.enums import ReferenceContext
from xosc_lateral.scenario.position import Orientation

_RELATIVE_SINCE = (1, 3)
"""Version from which an orientation without a type is relative; before, it was absolute."""


def is_absolute(orientation: Orientation | None, simulation: Simulation) -> bool:
    """Whether it is meant in the world; no orientation at all is relative (along the road, like the entity)."""
    if orientation is None:
        return False
    if orientation.type is None:
        return simulation.scenario.header.version < _RELATIVE_SINCE
    return orientation.type is ReferenceContext.ABSOLUTE


def tilted(orientation: Orientation | None, pitch: float, roll: float, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll: those of the reference plus what is given, or what is given alone where it is absolute. [rad]"""
    p, r = (0.0, 0.0) if orientation is None else (orientation.p or 0.0, orientation.r or 0.0)
    return (p, r) if is_absolute(orientation, simulation) else (pitch + p, roll + r)


def tilted_or_road(orientation: Orientation | None, pose: Pose, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll beside an entity; NaN (those of the road) where none are given. [rad]"""
    if orientation is None or (orientation.p is None and orientation.r is None):
        return nan, nan
    return tilted(orientation, pose.pitch, pose.roll, simulation)


def heading_of(orientation: Orientation | None) -> float:
    """Its heading; 0 where none is given. [rad]"""
    return 0.0 if orientation is None or orientation.h is None else orientation.h
