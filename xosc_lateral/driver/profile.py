"""Driver profile: a core model, the effects added to it, and where both come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any

from xosc_lateral.driver.core import CoreModel
from xosc_lateral.driver.effects import Effect, effect_from_dict
from xosc_lateral.driver.models import core_model_from_dict
from xosc_lateral.errors import DriverProfileError

FORMAT = "xosc-lateral driver profile"
VERSION = 1
"""Of the file format. A reader understands its own and every older version; new fields have a default."""

MAX_LANE_WIDTH = 10.0
"""Lanes that wide are none: 2 to 6 m is what measured ones have. [m]"""


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a profile comes from.

    Parameters
    ----------
    source : str
        The drives in words.
    licence : str
        Of the drives, and what it asks of who passes the profile on.
    hours : float
        Driving that was fitted, after cutting. [h]
    drives, runs : int
        How many.
    inputs : mapping of str to str
        File name -> SHA-256 of every table.
    fit : mapping
        Model and settings of the fit.
    evaluation : mapping
        Results on held-out drives, if there are any.
    package_version : str
        That wrote it.
    notes : str
    """

    source: str = ""
    licence: str = ""
    hours: float = 0.0
    drives: int = 0
    runs: int = 0
    inputs: Mapping[str, str] = field(default_factory=dict)
    fit: Mapping[str, Any] = field(default_factory=dict)
    evaluation: Mapping[str, Any] = field(default_factory=dict)
    package_version: str = ""
    notes: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Provenance:
        """Back from `to_dict`; what is absent keeps its default."""
        try:
            return cls(**values)
        except TypeError as error:
            raise DriverProfileError(f"provenance: {error}") from error


@dataclass(frozen=True, slots=True)
class DriverProfile:
    """What it takes to sample offsets.

    Parameters
    ----------
    name : str
    model : CoreModel
        Base movement.
    effects : tuple of Effect
        In the order in which they were found.
    lane_width : float
        Median width of the lanes that it was fitted on; where a lane's own width is unknown it stands in.
        Above 0, at most `MAX_LANE_WIDTH`. [m]
    provenance : Provenance

    Raises
    ------
    DriverProfileError
        If it has no name or its lane width is no width.
    """

    name: str
    model: CoreModel
    effects: tuple[Effect, ...] = ()
    lane_width: float = 3.75
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        """Check."""
        if not self.name:
            raise DriverProfileError("a profile needs a name")
        if not 0 < self.lane_width <= MAX_LANE_WIDTH:
            raise DriverProfileError(
                f"profile {self.name}: lane width {self.lane_width} m, expected above 0, at most {MAX_LANE_WIDTH:g} m"
            )
        object.__setattr__(self, "effects", tuple(self.effects))

    @property
    def columns(self) -> tuple[str, ...]:
        """Context columns that its effects read."""
        return tuple(sorted({column for effect in self.effects for column in effect.columns}))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, as the profile file holds them."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "name": self.name,
            "lane_width": self.lane_width,
            "model": self.model.to_dict(),
            "effects": [effect.to_dict() for effect in self.effects],
            "provenance": self.provenance.to_dict(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> DriverProfile:
        """Back from `to_dict`, of this version or an older one.

        Raises
        ------
        DriverProfileError
            If it is no profile, of a newer version, or contradicts itself.
        """
        values = _checked(values)
        effects = tuple(effect_from_dict(effect) for effect in values.get("effects", ()))
        return cls(
            name=str(values["name"]),
            model=core_model_from_dict(values["model"]),
            effects=effects,
            lane_width=float(values.get("lane_width", 3.75)),
            provenance=Provenance.from_dict(values.get("provenance", MappingProxyType({}))),
        )


def _checked(values: Mapping[str, Any]) -> Mapping[str, Any]:
    if not isinstance(values, Mapping) or values.get("format") != FORMAT:
        raise DriverProfileError(f'no driver profile: "format" is not "{FORMAT}"')
    version = values.get("version")
    if not isinstance(version, int) or version < 1:
        raise DriverProfileError(f"version {version!r}, expected a whole number from 1")
    if version > VERSION:
        raise DriverProfileError(f"written by a newer version ({version}) than this package reads (up to {VERSION})")
    for key, kind in (("name", str), ("model", Mapping)):
        if not isinstance(values.get(key), kind):
            raise DriverProfileError(f'"{key}" is missing or of the wrong kind')
    for key, kinds in (("effects", list), ("provenance", Mapping), ("lane_width", (int, float))):
        if key in values and not isinstance(values[key], kinds):
            raise DriverProfileError(f'"{key}" is of the wrong kind')
    if not all(isinstance(effect, Mapping) for effect in values.get("effects", ())):
        raise DriverProfileError('"effects" holds something that is no object')
    return values
