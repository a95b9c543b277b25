"""Which profile drives which entity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path

from xosc_lateral.base.errors import FormatError, did_you_mean
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import SHIPPED, find_profile, read_profile
from xosc_lateral.workflows.conversion.enrich import Drivers
from xosc_lateral.workflows.conversion.settings import AUTO, ConvertSettings
from xosc_lateral.world.scenario import Entity, Scenario
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.under_test import Control

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
