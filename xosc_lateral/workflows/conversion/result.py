"""What enriching and converting a scenario give, as data: the writer, the report and the manifest read it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import FloatArray, IntArray, rate
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.note import Note, Telling, warnings
from xosc_lateral.base.track import Track
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.model.plausibility import Bound
from xosc_lateral.drivers.model.profile import SIDES, Basis, DriverProfile
from xosc_lateral.files.source import read_source
from xosc_lateral.world.motion.gaps import Gap, contacts_of
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import Crossing, SegmentSpan
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.controllers import Control

if TYPE_CHECKING:
    from scenariogeneration import xosc

    from xosc_lateral.files.held import Held


class Neighbours(StrEnum):
    """What a conversion does where a profile's own answer to neighbours is not known, or whether there is any."""

    PROFILE = "profile"
    BORROW = "borrow"
    NONE = "none"


class LaneChanges(StrEnum):
    """The way across of lane changes and lane offsets."""

    WRITTEN = "written"
    LIFELIKE = "lifelike"


Drivers = Mapping[str, DriverProfile | str]
"""Per entity the profile that drives it, or the reason why it gets none."""

_WANTED = {
    "LaneOffsetActionDynamics": ("maxLateralAcc", "1e10"),  # without it there is no limit
    "LanePosition": ("offset", "0"),
    "RelativeLanePosition": ("offset", "0"),
}
"""Attributes that the standard lets one leave out and scenariogeneration's parser wants."""

NOMINAL_RUN = "nominal"
"""Name of the run in which vehicles under test drive as written; others are named by what theirs do."""

CONTACT_MOVED = 0.25
"""By which a contact comes earlier or later without a word. [s]"""
ROW_STEP = 0.1
"""Between rows that are drawn, and from which accelerations are taken. [s]"""

MODE_WORDS = {"trajectory": "a trajectory", "lane-offset": "paths beside its maneuvers"}
"""Modes of vehicles in words."""


@dataclass(frozen=True, eq=False, slots=True)
class SampledSegment:
    """Offsets sampled on one road-following segment."""

    span: SegmentSpan  # the segment
    time: FloatArray  # every 0.2 s of the driver's clock from the segment's start, shape (n,) [s]
    offset: FloatArray  # added to the nominal offset, positive left, shape (n,) [m]
    # beyond: how it would go on after the segment's end, should that come later, shape (k,) [m]
    beyond: FloatArray = field(default_factory=lambda: np.empty(0))
    distance: FloatArray | None = None  # driven at each, strictly increasing; None: where the vehicle is then [m]

    def later(self) -> tuple[FloatArray, FloatArray]:
        """Times after the segment's end, and offsets there. [s], [m]"""
        time = self.time[-1] + STEP * np.arange(1, len(self.beyond) + 1)
        return time[time > self.span.end], self.beyond[time > self.span.end]


@dataclass(frozen=True, eq=False, slots=True)
class EntityResult:
    """One entity, nominal and enriched."""

    motion: EntityMotion  # nominal
    spans: tuple[SegmentSpan, ...]  # all of its motion, road-following or not
    profile: DriverProfile | None  # None: not enriched, `why` says the reason
    why: str  # why it was not enriched; empty if it was
    segments: tuple[SampledSegment, ...]
    deviation: FloatArray  # of that path from the nominal one, positive left, shape (rows,) [m]
    trajectory: Track  # the enriched path; the nominal motion of an entity that is neither enriched nor towed
    # neutral: context columns that the profile's effects ask for and that were not known: without effect
    neutral: tuple[str, ...] = ()
    # bound: that sampled movement was smoothed since nobody could have driven it: the worst segment's
    bound: Bound | None = None
    # crossings: lane changes and lane offsets that its movement goes on through
    crossings: tuple[Crossing, ...] = ()

    @property
    def name(self) -> str:
        """The entity's name."""
        return self.motion.name

    @property
    def is_enriched(self) -> bool:
        """Whether offsets were sampled for it."""
        return bool(self.segments)

    def beside(self, neighbours: str) -> str:
        """How its driver responds to vehicles beside him, in a line."""
        if self.profile is None or neighbours == Neighbours.NONE:
            return "beside vehicles: does not move (--neighbours none)"
        may_borrow = neighbours == Neighbours.BORROW
        sides = [side for side in SIDES if may_borrow and self.profile.basis_of(side) is Basis.UNKNOWN]
        return self.profile.responses_in_words(sides)

    @property
    def segment_seconds(self) -> float:
        """Time in road-following segments that got offsets. [s]"""
        return sum(segment.span.end - segment.span.start for segment in self.segments)

    @property
    def offset_spread(self) -> float:
        """Standard deviation of the sampled offsets; 0 if there are none. [m]"""
        return float(np.std(np.concatenate([segment.offset for segment in self.segments]))) if self.segments else 0.0

    def lateral_acceleration(self) -> FloatArray:
        """Second time derivative of the deviation, what enriching added, at `shown_rows`, shape (k,). [m/s2]"""
        rows = shown_rows(self.motion)
        return _derivative(_derivative(self.deviation[rows], self.motion.time[rows]), self.motion.time[rows])

    def lateral_jerk(self) -> FloatArray:
        """Third time derivative of the deviation, at `shown_rows`, shape (k,). [m/s3]"""
        return _derivative(self.lateral_acceleration(), self.motion.time[shown_rows(self.motion)])


def shown_rows(motion: EntityMotion) -> IntArray:
    """Rows that are drawn, `ROW_STEP` apart, shape (k,)."""
    step = motion.time[1] - motion.time[0] if len(motion.time) > 1 else ROW_STEP
    return np.arange(0, len(motion.time), max(1, round(ROW_STEP / step)))


def nominal_result(entity: EntityMotion, spans: tuple[SegmentSpan, ...], why: str) -> EntityResult:
    """An entity as it moves nominally."""
    no_deviation = np.broadcast_to(0.0, len(entity.time))
    return EntityResult(entity, spans, None, why, (), no_deviation, entity)


def _derivative(values: FloatArray, time: FloatArray) -> FloatArray:
    return rate(values, float(time[1] - time[0])) if len(time) > 2 else np.zeros_like(values)


@dataclass(frozen=True, slots=True)
class LaneDeparture:
    """An enriched vehicle whose reference point leaves the lane that its nominal motion keeps."""

    name: str
    time: float
    beyond: float  # how far beyond the marking [m]


@dataclass(frozen=True, eq=False, slots=True)
class Enriched:
    """A played scenario with lifelike lateral movement."""

    motion: NominalMotion
    network: RoadNetwork
    entities: tuple[EntityResult, ...]  # in the scenario's order, all of them
    # gaps_before, gaps_after: smallest gaps of the pairs that come near each other, nominal and enriched
    gaps_before: tuple[Gap, ...]
    gaps_after: tuple[Gap, ...]
    departures: tuple[LaneDeparture, ...]
    seed: int  # seed, variant, attempt: what the samples were drawn with; `attempt` counts resamplings on request
    variant: int
    attempt: int

    def entity(self, name: str) -> EntityResult:
        """The entity of that name; `KeyError` if there is none."""
        for entity in self.entities:
            if entity.name == name:
                return entity
        raise KeyError(name)

    @property
    def new_contacts(self) -> tuple[Gap, ...]:
        """Pairs that touch now and did not before."""
        return _touching_only_in(self.gaps_after, self.gaps_before)

    @property
    def lost_contacts(self) -> tuple[Gap, ...]:
        """Pairs that touched before and do not now."""
        return _touching_only_in(self.gaps_before, self.gaps_after)

    @property
    def trouble(self) -> int:
        """Contacts and lane departures that nominally are none. [-]"""
        return len(self.new_contacts) + len(self.departures)

    def responses(self, neighbours: str) -> dict[str, list[str]]:
        """How drivers respond to vehicles beside them, a line each, with the names of those who do so."""
        return grouped((one.beside(neighbours), one.name) for one in self.entities if one.is_enriched)

    def contact_notes(self) -> Iterator[Note]:
        """Contacts that are new, that are gone, and that come earlier or later."""
        before, after = contacts_of(self.gaps_before), contacts_of(self.gaps_after)
        moved = {
            names: before[names]
            for names in after
            if names in before and abs(after[names] - before[names]) > CONTACT_MOVED
        }
        for names, what in (
            *(
                (gap.names, f"touch at {gap.time:.1f} s, and without the offsets they do not")
                for gap in self.new_contacts
            ),
            *(
                (gap.names, f"do not touch, as they do at {gap.time:.1f} s without the offsets")
                for gap in self.lost_contacts
            ),
            *((names, f"touch at {after[names]:.1f} s instead of at {then:.1f} s") for names, then in moved.items()),
        ):
            yield Note("'{}' and '{}' ".format(*names) + what, is_warning=True, run=NOMINAL_RUN)

    def warnings(self) -> Iterator[Note]:
        """What a user has to know of it."""
        yield from self.contact_notes()
        for departure in self.departures:
            what = f"'{departure.name}' leaves its lane at {departure.time:.1f} s by {departure.beyond:.2f} m"
            yield Note(what, is_warning=True, entity=departure.name, run=NOMINAL_RUN)
        for entity in self.entities:
            unknown = f"{', '.join(entity.neutral)} not known in the scenario: no effect of theirs"
            lines = [unknown] * bool(entity.neutral) + [entity.bound] * (entity.bound is not None)
            yield from warnings((f"{entity.name}: {what}" for what in lines), entity=entity.name)


def _touching_only_in(gaps: Sequence[Gap], others: Sequence[Gap]) -> tuple[Gap, ...]:
    touching = contacts_of(others)
    return tuple(gap for gap in gaps if gap.touches and gap.names not in touching)


class EventShift(Struct, frozen=True):
    """One action of an event with and without offsets, vehicles under test driving in one way. [s]"""

    event: str
    entity: str | None  # its actor
    time: float  # without offsets
    duration: float  # without offsets
    start: float  # how much later it starts with offsets
    end: float  # how much later it ends
    unexplained_start: float  # what of that is not the way of a lateral action
    unexplained_end: float
    lateral_speed: float = 0.0  # of the entity with offsets when a lateral action begins, which ends it [m/s]
    run: str = NOMINAL_RUN  # in which this is so: how vehicles under test drive


@dataclass(frozen=True, slots=True)
class ConversionProvenance:
    """What went into an output: enough to make the same bytes again."""

    package_version: str
    behaviour: int  # `version.BEHAVIOUR` of the program
    scenario: str  # where the scenario lies, as seen from the output
    # inputs: file name, as seen from the scenario -> SHA-256 of every file that was read (scenario, road,
    # catalogs, context)
    inputs: Mapping[str, str]
    profiles: Mapping[str, tuple[str, str]]  # enriched entity -> name and SHA-256 of its profile
    options: Mapping[str, Any]  # what was asked for: `ConvertSettings.record`
    variant: int  # from 1, as in file names
    version: str  # of the standard that was written
    ego: tuple[str, ...]  # vehicles under test: left as they are
    modes: Mapping[str, str]  # vehicle that was enriched -> "trajectory" or "lane-offset"
    content_sha256: str  # of the output without its provenance

    @property
    def mode(self) -> str:
        """Of all vehicles that were enriched: "trajectory", "lane-offset", "mixed"; empty: nobody was."""
        modes = sorted(set(self.modes.values()))
        return "mixed" if len(modes) > 1 else "".join(modes)


@dataclass(eq=False, repr=False, slots=True)
class ConvertedScenario(Telling):
    """A converted scenario: nominal and enriched motion, what to know about it, and how to get it again."""

    source: Path  # the scenario that was read
    output: Path | None  # the scenario that was written; None if none was
    sha256: str  # of the output's bytes
    movement: Enriched  # nominal and enriched motion, segments, gaps
    provenance: ConversionProvenance
    messages: tuple[Note, ...] = ()  # what a user has to know
    content: bytes = b""  # the output's bytes, but for a replay that was written
    is_replay: bool = True  # everything happens by the clock of the nominal run, whoever drives
    # shifts: how much earlier or later events of a reactive output come, in the nominal run and under other egos [s]
    shifts: tuple[EventShift, ...] = ()
    trial_contacts: tuple[str, ...] = ()  # new ones that only come about under other egos, a line each
    controllers: Mapping[str, Control] = field(default_factory=dict)  # of entities that are left to them
    egos: Mapping[str, str] = field(default_factory=dict)  # vehicles under test, and why each is one
    report: Path | None = None  # page that was written, if one was
    road_file: Path | None = None
    held: Held | None = None  # what was read from memory

    @property
    def data(self) -> bytes:
        """The converted scenario's bytes."""
        return self.content if self.output is None else self.output.read_bytes()

    @property
    def road(self) -> bytes | None:
        """Bytes of its road; None: it has none."""
        return None if self.road_file is None else read_source(self.road_file).data

    def to_scenariogeneration(self) -> xosc.Scenario:
        """The converted scenario as an object of scenariogeneration; `FormatError`: it can't be read."""
        from traceback import walk_tb
        from xml.etree import ElementTree

        from scenariogeneration import xosc

        try:
            tree = ElementTree.fromstring(self.data)
            for item in tree.iter():
                if item.tag in _WANTED:
                    item.attrib.setdefault(*_WANTED[item.tag])
            return xosc.Scenario.parse(tree)
        except Exception as error:  # whatever it did not expect
            read = [frame.f_locals.get("element") for frame, _ in walk_tb(error.__traceback__)]
            element = next((one.tag for one in reversed(read) if isinstance(one, ElementTree.Element)), None)
            what = f"scenariogeneration's parser can't read it: {error or type(error).__name__}; `data` is complete"
            raise FormatError(what, path=self.output or self.source, element=element) from error

    @property
    def entities(self) -> tuple[str, ...]:
        """All entities, in the scenario's order."""
        return tuple(entity.name for entity in self.movement.entities)

    @property
    def enriched(self) -> tuple[str, ...]:
        """Those that got offsets."""
        return tuple(entity.name for entity in self.movement.entities if entity.is_enriched)

    @property
    def ego(self) -> tuple[str, ...]:
        """Vehicles under test: left as they are."""
        return self.provenance.ego

    @property
    def modes(self) -> dict[str, str]:
        """Vehicle that was enriched -> "trajectory" or "lane-offset"."""
        return dict(self.provenance.modes)

    @property
    def cut_off(self) -> str | None:
        """The warning of a run that the time limit cut off."""
        note = self.movement.motion.cut_off
        return None if note is None else str(note)

    @property
    def end_time(self) -> float:
        """[s]"""
        return self.movement.motion.end_time

    @property
    def smallest_gap(self) -> tuple[float | None, float | None]:
        """Smallest free space between two vehicles, nominal and enriched; None: none come near each other. [m]"""
        sides = (self.movement.gaps_before, self.movement.gaps_after)
        before, after = (min((gap.distance for gap in gaps), default=None) for gaps in sides)
        return before, after

    @property
    def under_test(self) -> str:
        """Vehicles that are not the storyboard's: under test, or driven by controllers, in a line."""
        egos = ", ".join(f"{name} ({why})" for name, why in self.egos.items())
        lines = [f"under test, left as written: {egos}"] if egos else []
        lines += [f"'{name}' is left to controller {control}" for name, control in self.controllers.items()]
        if lines:
            return "; ".join(lines)
        return "no vehicle under test: " + (
            "everything is replayed" if self.is_replay else "maneuvers that stay react to the run"
        )
