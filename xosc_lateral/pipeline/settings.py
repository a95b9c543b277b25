"""What a user can choose for a conversion; plain values, so that a batch can send and hash them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

STEP = 0.02
"""Of playback, as in the reference logs. [s]"""

TIME_LIMIT = 60.0
"""A scenario that does not end by itself is ended after this. [s]"""

AUTO = "auto"
"""Profile name that picks one of the shipped profiles by the vehicle's class."""


class Mode(StrEnum):
    """How offsets are written."""

    TRAJECTORY = "trajectory"
    LANE_OFFSET = "lane-offset"


@dataclass(frozen=True, slots=True)
class ConvertSettings:
    """Settings of one conversion.

    Parameters
    ----------
    profile : str
        Name or path of the profile for every vehicle; "auto": a shipped one by the vehicle's class.
    entity_profiles : mapping of str to str
        Entity name -> profile name or path, before `profile`.
    only : frozenset of str or None
        Enrich these entities alone.
    seed : int
    context : Path or None
        Table of context over time that the scenario doesn't state.
    parameters : mapping of str to str
        Scenario parameters that replace those declared.
    attempts : int
        Sample anew up to so many times while vehicles touch or leave their lane that nominally don't.
    mode : Mode
    libraries : tuple of Path
        Folders with further profiles.
    allowed : tuple of Path
        Folders, besides those around the scenario, that its road and catalogs may lie in.
    step, time_limit : float
        Of playback. [s]
    """

    profile: str = AUTO
    entity_profiles: Mapping[str, str] = field(default_factory=dict)
    only: frozenset[str] | None = None
    seed: int = 0
    context: Path | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    attempts: int = 1
    mode: Mode = Mode.TRAJECTORY
    libraries: tuple[Path, ...] = ()
    allowed: tuple[Path, ...] = ()
    step: float = STEP
    time_limit: float = TIME_LIMIT
