"""Where a scenario is outside of what its drivers' profiles were measured for: proving grounds, speeds, lane widths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.rows import blocks
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import SegmentSpan
from xosc_lateral.world.road.network import RoadNetwork

PROVING_GROUND_WIDTH = 6.0
"""A lane wider than this is none of a road (2 to 6 m are), but a proving ground's: vehicles keep to lines that the
scenario's geometry draws, and not to a lane. [m]"""

Drivers = Mapping[str, DriverProfile | str]


def without_proving_grounds(
    drivers: Drivers, motion: NominalMotion, network: RoadNetwork, named: Iterable[str]
) -> Drivers:
    """Drivers, but for vehicles in a lane that is none of a road: why they get none. `named` ones keep theirs."""
    kept = set(named)
    found = dict(drivers)
    for entity in motion.entities:
        if isinstance(found.get(entity.name), DriverProfile) and entity.name not in kept:
            width = _median_width(entity, network)
            if width > PROVING_GROUND_WIDTH:
                found[entity.name] = (
                    f"lane of {width:.1f} m, a proving ground's: keeps its line (--entity NAME=PROFILE moves it)"
                )
    return found


def _median_width(entity: EntityMotion, network: RoadNetwork) -> float:
    """Of the lanes that an entity is in, a row a second; 0 where it is in none. [m]"""
    step = max(1, len(entity.time) // max(1, round(float(entity.time[-1] - entity.time[0]))))
    road, lane, s = entity.road[::step], entity.lane[::step], entity.s[::step]
    there = np.asarray(road >= 0, dtype=np.bool_) & np.asarray(lane != 0, dtype=np.bool_)
    return float(np.median(network.lane_width(road[there], lane[there], s[there]))) if there.any() else 0.0


def validity_warnings(enriched: Enriched) -> tuple[str, ...]:
    """A line for each profile that moves vehicles at speeds or in lanes that it was not measured in."""
    speeds: dict[str, list[FloatArray]] = {}
    widths: dict[str, list[FloatArray]] = {}
    profiles: dict[str, DriverProfile] = {}
    for entity in enriched.entities:
        if entity.profile is None or not entity.segments:
            continue
        name = entity.profile.name
        profiles[name] = entity.profile
        speed, width = _driven(entity, enriched.network)
        speeds.setdefault(name, []).append(speed)
        widths.setdefault(name, []).append(width)
    lines = []
    for name, profile in profiles.items():
        outside = profile.validity.departures(np.concatenate(speeds[name]), np.concatenate(widths[name]))
        if outside:
            lines.append(f"profile {name} is used beyond what was measured: {'; '.join(outside)}")
    return tuple(lines)


def _driven(entity: EntityResult, network: RoadNetwork) -> tuple[FloatArray, FloatArray]:
    """Least and greatest speed [m/s] and lane width [m] where offsets were sampled."""
    found = [_extremes(entity.motion, segment.span, network) for segment in entity.segments]
    return np.array([value for speed, _ in found for value in speed]), np.array(
        [value for _, width in found for value in width]
    )


def _extremes(
    motion: EntityMotion, span: SegmentSpan, network: RoadNetwork
) -> tuple[tuple[float, float], tuple[float, float]]:
    speed, width = [], []
    for rows in blocks(span.last + 1, span.first):
        speed += [float(motion.speed[rows].min()), float(motion.speed[rows].max())]
        wide = np.median(network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows]))
        width.append(float(wide))  # a lane that begins or ends is narrow for a moment
    return (min(speed), max(speed)), (min(width), max(width))
