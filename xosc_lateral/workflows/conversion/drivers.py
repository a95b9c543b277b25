"""Which profile drives which entity, and where a scenario is outside of what that was measured for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, did_you_mean
from xosc_lateral.base.rows import blocks
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import SHIPPED, find_profile, read_profile
from xosc_lateral.workflows.conversion.enrich import Drivers
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult
from xosc_lateral.workflows.conversion.settings import AUTO, ConvertSettings
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import SegmentSpan
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.dependence import Control
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.scenario import Scenario

AUTO_PROFILE = "motorway"
"""What "auto" chooses: it gives every class, lane and speed its own. Motorcycles ride like cars for want of measured
ones."""

NO_DRIVER = {
    VehicleCategory.TRAILER: "a trailer has no driver",
    VehicleCategory.TRAIN: "a train is bound to its track",
    VehicleCategory.TRAM: "a tram is bound to its track",
    VehicleCategory.BICYCLE: "there is no profile for bicycles; name one with --entity",
}
"""Vehicles that "auto" leaves alone, and why."""

PROVING_GROUND_WIDTH = 6.0
"""A lane wider than this, alone in its direction, is none of a road (2 to 6 m are), but a proving ground's: vehicles
keep to lines that the scenario's geometry draws, and not to a lane. [m]"""


def choose_drivers(
    scenario: Scenario,
    settings: ConvertSettings,
    egos: Mapping[str, str] | None = None,
    controllers: Mapping[str, Control] | None = None,
) -> Drivers:
    """Per entity its profile, or why it gets none.

    `egos`: the vehicles under test, and why each is one; `controllers`: those of entities that are left to them.

    Raises `FormatError`: if the settings name an entity that the scenario doesn't have; `DriverProfileError`: if a
    profile is not known.
    """
    known = {entity.name for entity in scenario.entities}
    asked = (("--entity", settings.entity), ("--only", settings.only or ()), ("--ego", settings.ego or ()))
    for option, names in () if settings.names_may_lack else asked:
        for name in sorted(names):
            if name not in known:
                raise FormatError(
                    f"{option} {name!r}: no such entity{did_you_mean(name, known)}; "
                    f"there are {', '.join(sorted(known)) or 'none'}",
                    path=scenario.path,
                )
    left = {name: f"vehicle under test: {why}" for name, why in (egos or {}).items()}
    left |= {name: f"driven by controller {control}" for name, control in (controllers or {}).items()}
    read = cache(partial(read_profile, folders=settings.library))
    return {entity.name: left.get(entity.name) or _driver(entity, settings, read) for entity in scenario.entities}


def _driver(entity: Entity, settings: ConvertSettings, read: Callable[[str], DriverProfile]) -> DriverProfile | str:
    if not entity.is_vehicle:
        return f"a {entity.category.value}, no vehicle"
    if settings.only is not None and entity.name not in settings.only:
        return "not chosen (--only)"
    named = settings.entity.get(entity.name, settings.profile)
    if named == AUTO:
        category = entity.vehicle_category or VehicleCategory.CAR
        if category in NO_DRIVER:
            return NO_DRIVER[category]
        named = AUTO_PROFILE
    return named if isinstance(named, DriverProfile) else read(named)


def uses_auto(settings: ConvertSettings) -> bool:
    """Whether "auto" chooses for any entity."""
    return AUTO in (settings.profile, *settings.entity.values())


def hidden_by_libraries(libraries: tuple[Path, ...]) -> tuple[str, ...]:
    """A line where "auto" takes one of the user's profiles in place of the shipped one."""
    path = find_profile(AUTO_PROFILE, libraries)
    return () if path.parent == SHIPPED else (f"{path} hides the shipped profile {AUTO_PROFILE!r}: auto takes it",)


def without_proving_grounds(
    drivers: Drivers, motion: NominalMotion, network: RoadNetwork, named: Iterable[str]
) -> Drivers:
    """Drivers, but for vehicles in a lone lane that is none of a road: why they get none. `named` ones keep theirs."""
    kept = set(named)
    moved = dict(drivers)
    for entity in motion.entities:
        if isinstance(moved.get(entity.name), DriverProfile) and entity.name not in kept:
            width, lanes = _usual_lane(entity, network)
            if width > PROVING_GROUND_WIDTH and lanes <= 1.0:
                moved[entity.name] = (
                    f"lane of {width:.1f} m, a proving ground's: keeps its line (--entity NAME=PROFILE moves it)"
                )
    return moved


def _usual_lane(entity: EntityMotion, network: RoadNetwork) -> tuple[float, float]:
    """Medians over a row a second: width of its lane [m], and driving lanes of its direction; 0 where it is in none."""
    step = max(1, len(entity.time) // max(1, round(float(entity.time[-1] - entity.time[0]))))
    rows = np.flatnonzero((entity.road[::step] >= 0) & (entity.lane[::step] != 0)) * step
    if not len(rows):
        return 0.0, 0.0
    road, lane, s = entity.road[rows], entity.lane[rows], entity.s[rows]
    return float(np.median(network.lane_width(road, lane, s))), float(np.median(network.lane_index(road, lane, s)[1]))


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
    extremes = np.array([_extremes(entity.motion, segment.span, network) for segment in entity.segments])
    return extremes[:, 0].ravel(), extremes[:, 1].ravel()


def _extremes(
    motion: EntityMotion, span: SegmentSpan, network: RoadNetwork
) -> tuple[tuple[float, float], tuple[float, float]]:
    speed, width = [], []
    for rows in blocks(span.last + 1, span.first):
        speed += [float(motion.speed[rows].min()), float(motion.speed[rows].max())]
        wide = np.median(network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows]))
        width.append(float(wide))  # a lane that begins or ends is narrow for a moment
    return (min(speed), max(speed)), (min(width), max(width))
