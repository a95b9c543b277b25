"""What a user can choose for a conversion; plain values, so that a batch can send and hash them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from xosc_lateral.enrich.neighbours import Neighbours
from xosc_lateral.formats.openscenario.read import NO_ROADS, RoadSearch
from xosc_lateral.formats.openscenario.write.target import STANDARD, TargetPlayer

if TYPE_CHECKING:
    from xosc_lateral.driver.profile import DriverProfile

STEP = 0.02
"""Of playback, as in the reference logs. [s]"""

AUTO = "auto"
"""Profile name for the shipped population, and for nobody who has no driver (a trailer, a tram)."""


class OutputMode(StrEnum):
    """How offsets are written: by vehicle as it depends on a vehicle under test, or the same for all."""

    AUTO = "auto"
    TRAJECTORY = "trajectory"
    LANE_OFFSET = "lane-offset"


NO_EGO = "none"
"""In place of a vehicle under test: there is none."""


def egos_named(names: Collection[str] | None) -> frozenset[str] | None:
    """Vehicles under test as a user names them: None where nobody said anything, empty for "none".

    Raises
    ------
    ValueError
        For "none" beside a name.
    """
    if names is None:
        return None
    if NO_EGO in names and len(names) > 1:
        raise ValueError(f"ego {', '.join(sorted(names))}: {NO_EGO!r} stands alone")
    return frozenset(names) - {NO_EGO}


@dataclass(frozen=True, slots=True)
class ConvertSettings:
    """Settings of one conversion.

    Parameters
    ----------
    profile : str or DriverProfile
        Profile of every vehicle, or its name or path; "auto": the shipped population's, `motorway`.
    entity_profiles : mapping of str to str or DriverProfile
        Entity name -> profile, its name or path, before `profile`.
    only : frozenset of str or None
        Enrich these entities alone.
    seed : int
    context : Path or None
        Table of context over time that the scenario doesn't state.
    parameters : mapping of str to str
        Scenario parameters that replace those declared.
    attempts : int
        Sample anew up to so many times while vehicles touch or leave their lane that nominally don't.
    mode : OutputMode
    ego : frozenset of str or None
        Vehicles under test, beside those that the scenario leaves to somebody else; None: those alone; empty: none.
    names_may_lack : bool
        `entity_profiles`, `only` and `ego` apply where an entity of that name exists: one of many scenarios.
    target : TargetPlayer
        Player and version of the standard to write for.
    libraries : tuple of Path
        Folders with further profiles.
    allowed : tuple of Path
        Folders, besides those around the scenario, that its road and catalogs may lie in.
    roads : RoadSearch
        Where else its road may lie.
    strict : bool
        Refuse a missing vehicle catalog, instead of playing a usual car.
    step : float
    time_limit : float or None
        Of playback; None: see `playback.player.play`. [s]
    with_sensor : bool
        Add the sensor error of the drives that profiles were fitted on.
    neighbours : Neighbours
        Whose answer to vehicles beside them drivers have.
    """

    profile: str | DriverProfile = AUTO
    entity_profiles: Mapping[str, str | DriverProfile] = field(default_factory=dict)
    only: frozenset[str] | None = None
    seed: int = 0
    context: Path | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    attempts: int = 1
    mode: OutputMode = OutputMode.AUTO
    ego: frozenset[str] | None = None
    names_may_lack: bool = False
    target: TargetPlayer = STANDARD
    libraries: tuple[Path, ...] = ()
    allowed: tuple[Path, ...] = ()
    roads: RoadSearch = NO_ROADS
    strict: bool = False
    step: float = STEP
    time_limit: float | None = None
    with_sensor: bool = False
    neighbours: Neighbours = Neighbours.BORROW
