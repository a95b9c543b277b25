"""Driver profile: a core model, the effects added to it, where both come from, and what it says of itself."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from msgspec import Meta, defstruct, field, structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.names import unwritable
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.model.core.base import CoreModel
from xosc_lateral.drivers.model.core.registry import any_model
from xosc_lateral.drivers.model.effects import Effect, any_effect
from xosc_lateral.drivers.model.records import Record, read_as, set_once
from xosc_lateral.drivers.model.sensor import SensorModel
from xosc_lateral.drivers.model.validity import Validity

# ---- how drivers of a recording change lanes: a law of nine numbers with their intervals, and the way before ----
# A lane change lasts e^x s, x normal: behind somebody with a mean that grows with the logarithm of the gap, else with
# one of its own. That, how often there is somebody, to which side, how many an hour and how many are given up are
# figures of a population; of one recording, in which neither speed nor side nor driver said more about the duration.
BEFORE_STEP = 0.2
"""Of the mean way before. [s]"""


class Figure(NamedTuple):
    """A figure of a law and its 95 % interval, in its own unit."""

    value: float
    low: float
    high: float

    def in_words(self, unit: str, digits: int = 1, scale: float = 1.0) -> str:
        """With its interval."""
        value, low, high = (f"{scale * one:.{digits}f}" for one in self)
        return f"{value} {unit} ({low} to {high})"


class Spread(NamedTuple):
    """Mean and standard deviation over drivers, each with its interval."""

    mean: Figure
    deviation: Figure


class Maneuvers(Record, frozen=True):
    """Lane changes of drivers; raises `DriverProfileError` if a figure is out of its range."""

    changes: Annotated[int, Meta(ge=1, description="Lane changes that were measured.")]
    hours: Annotated[float, Meta(gt=0, description="Of lane keeping beside them. [h]")]
    # Median durations [s], their exponent of the gap [-], and standard deviations of their logarithm [-].
    duration_alone: Annotated[Figure, Meta(description="Median duration with nobody ahead. [s]")]
    spread_alone: Annotated[Figure, Meta(description="Standard deviation of its logarithm. [-]")]
    gap: Annotated[Figure, Meta(description="To a vehicle ahead at the begin: mean by logarithm, 5 %, 95 %. [m]")]
    duration_behind: Annotated[Figure, Meta(description="Median duration at the mean gap. [s]")]
    gap_exponent: Annotated[Figure, Meta(description="Power of the gap that it grows with. [-]")]
    spread_behind: Annotated[Figure, Meta(description="Standard deviation of its logarithm. [-]")]
    behind: Annotated[Figure, Meta(description="Share with a vehicle ahead within sight. [-]")]
    left: Annotated[Figure, Meta(description="Share to the left. [-]")]
    rate: Annotated[Figure, Meta(description="An hour of lane keeping. [1/h]")]
    given_up: Annotated[Figure, Meta(description="Share that is given up, of all that begin. [-]")]
    # By side. Where they end, from the middle of the new lane, and the change of speed meanwhile.
    end: Annotated[Mapping[str, Spread], Meta(description="Offset at the end, positive left. [m]")] = {}
    speed_change: Annotated[Mapping[str, Spread], Meta(description="Change of speed until the end. [m/s]")] = {}
    # By side, every 0.2 s up to the begin: from where they drive at the first of these moments, positive left. [m]
    before: Annotated[Mapping[str, tuple[float, ...]], Meta(description="Mean way before, by side. [m]")] = {}
    recording: str = ""

    def __post_init__(self) -> None:
        for name in ("duration_alone", "duration_behind", "spread_alone", "spread_behind", "gap"):
            if not getattr(self, name).value > 0.0:
                raise DriverProfileError(f"maneuvers: {name} {getattr(self, name).value:g}, expected above 0")

    def duration(self, normal: FloatArray | float, gap: float = np.nan) -> FloatArray:
        """Of a driver at so many standard deviations from the median, shape as `normal`. [s]

        `gap`: to the vehicle ahead when it begins [m], beyond those that were measured as at the nearest of these; NaN:
        there is none within sight.
        """
        if np.isfinite(gap):
            ratio = float(np.clip(gap, self.gap.low, self.gap.high)) / self.gap.value
            median = self.duration_behind.value * ratio**self.gap_exponent.value
            return np.asarray(median * np.exp(self.spread_behind.value * np.asarray(normal)))
        return np.asarray(self.duration_alone.value * np.exp(self.spread_alone.value * np.asarray(normal)))

    def anticipation(self, time: FloatArray, begin: float, end: float, *, left: bool, free: float) -> FloatArray:
        """How drivers move in the seconds before a lane change from `begin` to `end`: offset, positive left. [m]

        At times, shape (n,); from the end of the maneuver before on (`free`). What is left at the begin fades until the
        end. [s]
        """
        way = np.array(self.before.get("left" if left else "right", (0.0,)))
        moments = begin + BEFORE_STEP * np.arange(1 - len(way), 1)
        first = min(max(moments[0], free), begin)
        moved = np.interp(time, moments, way) - np.interp(first, moments, way)
        fading = 0.5 + 0.5 * np.cos(np.pi * np.clip((time - begin) / (end - begin), 0.0, 1.0))
        return np.asarray(np.where(time < first, 0.0, moved * fading))

    def in_words(self) -> str:
        """In a line."""
        gap = f"{self.gap.value:.0f} m behind a vehicle"
        return (
            f"{self.changes} lane changes, {self.rate.in_words('an hour of lane keeping', 0)}, "
            f"{self.duration_alone.in_words('s')} with nobody ahead, {self.duration_behind.in_words('s')} {gap}; "
            f"{self.left.in_words('% to the left', 0, 100.0)}; {self.given_up.in_words('% given up', 0, 100.0)}"
        )


# ---- the profile ----
SIDES = ("left", "right")

COLUMNS = {side: (f"{side}_distance", f"{side}_is_truck", f"truck_{side}", f"car_{side}") for side in SIDES}
"""Context columns by which a profile answers to vehicles on a side by itself."""


class Basis(StrEnum):
    """Where it is known from how a driver answers to neighbours on one side."""

    MEASURED = "measured"
    DECLARED = "declared"
    POPULATION = "population"
    UNKNOWN = "unknown"


class Beside(Record, frozen=True):
    """What is known of a driver's answer to vehicles on one side.

    Of the basis `population` it was measured on many drivers, pair by pair: `convert` spreads their gaps as that
    recording has them.
    """

    basis: Basis
    seconds: Annotated[float, Meta(ge=0, description="Driving with somebody there. [s]")] = 0.0
    shift: Annotated[float, Meta(description="With somebody alongside, positive left. [m]")] = 0.0
    error: Annotated[float, Meta(ge=0, description="Standard error. [m]")] = 0.0


POPULATION = {side: Beside(Basis.POPULATION) for side in SIDES}
"""Of profiles whose effects are of the recording that the law of `surroundings.give_way` was measured in."""

SIGNIFICANT_ERRORS = 2.6
"""Standard errors from which a shift beside a vehicle is an effect: one of a hundred by chance. [-]"""

UNMEASURED_RESPONSES = {
    Basis.POPULATION: "responds as the drivers in the profile's recording did",
    Basis.DECLARED: "moves as its effects state",
    Basis.MEASURED: "moves as its effects state",
    Basis.UNKNOWN: "not known, does not move",
}
"""How a driver responds to vehicles beside him, by what that rests on, where the profile holds no figure."""


class Provenance(Record, frozen=True):
    """Where a profile comes from."""

    source: Annotated[str, Meta(description="The drives in words.")] = ""
    licence: Annotated[str, Meta(description="Of the drives.")] = ""
    hours: Annotated[float, Meta(ge=0, description="Driving fitted, after cutting. [h]")] = 0.0
    drives: Annotated[int, Meta(ge=0)] = 0
    runs: Annotated[int, Meta(ge=0)] = 0
    inputs: Annotated[Mapping[str, str], Meta(description="File name to SHA-256.")] = field(default_factory=dict)
    fit: Annotated[Mapping[str, Any], Meta(description="Model and settings of the fit.")] = field(default_factory=dict)
    evaluation: Annotated[Mapping[str, Any], Meta(description="Results on held-out drives.")] = field(
        default_factory=dict
    )
    package_version: str = ""
    notes: str = ""


class Metadata(Record, frozen=True):
    """What a profile is of, to be searched by; all of it is optional."""

    version: str = ""  # Of the profile itself, as its owners count: "2", "1.3".
    driver: str = ""
    vehicle: str = ""
    road: str = ""  # Whom and what was measured, and where: "professional", "truck", "motorway".
    country: str = ""  # ISO 3166-1 alpha-2: "DE".
    date: str = ""  # When the drives were recorded, ISO 8601: "2026-05", "2026-05-03/2026-06-01".
    licence: str = ""  # Of the profile.
    tags: tuple[str, ...] = ()


FORMAT = "xosc-lateral driver profile"

VERSION = 2
"""Of the file format."""

MAX_LANE_WIDTH = 10.0
"""Lanes that wide are none: 2 to 6 m is what measured ones have. [m]"""


class DriverProfile(Record, frozen=True):
    """What it takes to sample offsets. Raises `DriverProfileError` if a name is none, or its lane width is no width."""

    later = ("left_hand", "beside", "validity", "maneuvers")

    name: str = field(name="id")  # The same in the file, in the file's name and wherever it is looked up.
    model: CoreModel  # Base movement.
    effects: tuple[Effect, ...] = ()  # In the order in which they were found.
    # Median width of the lanes that it was fitted on; where a lane's own width is unknown it stands in. [m]
    lane_width: float = 3.75
    provenance: Provenance = field(default_factory=Provenance)
    metadata: Metadata = field(default_factory=Metadata)
    sensor: SensorModel | None = None  # What it added to the drives that were fitted, where that is known.
    left_hand: bool = False  # Fitted on left-hand traffic. On a road of the other hand it is sampled as in a mirror.
    beside: Mapping[str, Beside] = field(default_factory=dict)  # Whether its response on a side is known, and how.
    validity: Validity = Validity()  # Where it is known to hold.
    maneuvers: Maneuvers | None = None  # How its drivers change lanes, where that was measured.

    def __post_init__(self) -> None:
        if not self.name:
            raise DriverProfileError("a profile needs a name")
        if (why := next(filter(None, map(unwritable, (self.name, *self.columns))), None)) is not None:
            raise DriverProfileError(f"profile {self.name}: {why}")
        if not 0 < self.lane_width <= MAX_LANE_WIDTH:
            raise DriverProfileError(
                f"profile {self.name}: lane width {self.lane_width} m, expected above 0, at most {MAX_LANE_WIDTH:g} m"
            )
        if abs(self.model.step - STEP) > 1e-9 * STEP:
            raise DriverProfileError(
                f"profile {self.name}: model.step {self.model.step} s; drivers have steps of {STEP} s"
            )
        for side in self.beside:
            if side not in SIDES:
                raise DriverProfileError(f"profile {self.name}: beside {side!r}, expected left or right")
        set_once(self, effects=tuple(self.effects))

    def __repr__(self) -> str:
        known = self.provenance
        effects = f"{len(self.effects)} effect{'' if len(self.effects) == 1 else 's'}"
        return f"<DriverProfile {self.name}: {self.model.kind}, {effects}, {known.hours:g} h of {known.drives} drives>"

    def scales(self, width: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Metres that one unit of the coarse and of the fine part is in lanes of a width, shape (n,). [m]

        Drivers use the lane that they have, up to the widest that was measured; the noise of steering knows no lane.
        Where that is not stated, as in files of older versions, both are shares of the width.
        """
        measured = self.validity.lane_width
        if measured is None:
            return width, width
        coarse = np.minimum(width, measured[1])
        return coarse, coarse if self.model.fine_scales_with_lane else np.full(np.shape(width), self.lane_width)

    def with_effects(self, *effects: Effect, name: str | None = None) -> DriverProfile:
        """A profile with further effects, under another name if one is given."""
        return structs.replace(self, name=name or self.name, effects=(*self.effects, *effects))

    @property
    def columns(self) -> tuple[str, ...]:
        """Context columns that its effects read."""
        return tuple(sorted({column for effect in self.effects for column in effect.columns}))

    def basis_of(self, side: str) -> Basis:
        """Where its response to neighbours on a side is known from.

        A shift that was measured and that no effect makes is as good as unknown; one that effects make and of which
        nothing else is said was measured by who found them.
        """
        responds, known = any(column in COLUMNS[side] for column in self.columns), self.beside.get(side)
        if known is None or known.basis is Basis.UNKNOWN:
            return Basis.MEASURED if responds else Basis.UNKNOWN
        if known.basis is Basis.MEASURED and not responds and abs(known.shift) > SIGNIFICANT_ERRORS * known.error:
            return Basis.UNKNOWN
        return known.basis

    def responses_in_words(self, borrowed: Collection[str] = ()) -> str:
        """How a driver responds to vehicles on either side, in a line; on `borrowed` sides as the population does."""

        def in_words(side: str) -> str:
            if side in borrowed:
                return "not known, moves as the population does"
            basis, known = self.basis_of(side), self.beside.get(side)
            if known is None or not known.seconds:
                return UNMEASURED_RESPONSES[basis]
            way = "left" if known.shift > 0 else "right"
            return f"moves {abs(known.shift):.2f} +- {known.error:.2f} m to the {way} ({basis}, {known.seconds:.0f} s)"

        left, right = map(in_words, SIDES)
        if left == right:
            return f"beside vehicles on either side: {left}"
        return f"beside vehicles on the left: {left}; beside vehicles on the right: {right}"

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, as the profile file holds them."""
        values = super().to_dict()
        values["effects"] = [effect.to_dict() for effect in self.effects]
        values["sensor"] = None if self.sensor is None else self.sensor.to_dict()
        order = (
            "id",
            "metadata",
            "validity",
            "lane_width",
            "left_hand",
            "model",
            "effects",
            "beside",
            "sensor",
            "maneuvers",
        )
        present = {name: values[name] for name in (*order, "provenance") if name in values}
        return {"format": FORMAT, "version": VERSION, **present}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> DriverProfile:
        """Back from `to_dict`.

        Raises `DriverProfileError` if it is no profile, of another version, or contradicts itself; names the field and
        where it stands.
        """
        if not isinstance(values, Mapping) or values.get("format") != FORMAT:
            raise DriverProfileError(f'not a driver profile: "format" is not "{FORMAT}"')
        version = values.get("version")
        if version != VERSION or isinstance(version, bool):
            cure = ": update the package" if isinstance(version, int) and version > VERSION else ""
            raise DriverProfileError(f"file format {version!r}; this version of xosc-lateral reads {VERSION}{cure}")
        present = {name: value for name, value in values.items() if name not in ("format", "version")}
        effects = present.get("effects")
        effects = effects if isinstance(effects, list) else ()
        kinds = [effect.get("kind") for effect in effects if isinstance(effect, Mapping)]
        model = present.get("model")
        kind = model.get("kind") if isinstance(model, Mapping) else None
        read = read_as(file_type(str(kind), frozenset(map(str, kinds))), present)
        return cls(**{name: getattr(read, name) for name in cls.__struct_fields__})


@lru_cache(maxsize=16)
def file_type(model: str, effects: frozenset[str]) -> type[DriverProfile]:
    """A profile's type with all models and effects spelt out, for reading and for the JSON Schema.

    By their kinds in the file; plug-ins are searched when one is not of this package.
    """
    known: Any = tuple[any_effect(effects), ...]  # type: ignore[misc]  # known only now
    fields: list[Any] = [("model", any_model(model)), ("effects", known, ())]
    made: Any = defstruct("DriverProfile", fields, bases=(DriverProfile,), frozen=True, kw_only=True)
    return made  # type: ignore[no-any-return]


def sampling_hash(profile: DriverProfile) -> str:
    """SHA-256 of what a profile's offsets depend on; what only describes it may change."""
    values = profile.to_dict()
    parts = {name: values[name] for name in ("lane_width", "model", "effects")}
    if profile.validity.lane_width is not None:
        parts["lane_width_measured"] = profile.validity.lane_width
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
