"""Sources of `detect`, scene by scene: scenarios as written and lifelike, drive tables, recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from xosc_lateral.base.errors import FormatError, NotEnoughDataError, absent
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.drivers.drives.drive import HALF_WIDTH, Drive
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, Sensor, View, views_of
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack, Scene, in_lanes, tracks_of
from xosc_lateral.extras.recordings.importers.track_table import USUAL_LENGTH
from xosc_lateral.extras.recordings.lane_order import RoadLanes
from xosc_lateral.extras.recordings.recorded import place_tracks
from xosc_lateral.extras.recordings.recordings import (
    REAR_AXLE,
    USUAL_WIDTH,
    RecordedTraffic,
    format_of,
    read_recordings,
)
from xosc_lateral.files.held import Held, exists
from xosc_lateral.files.mapping import TableMapping, as_mapping
from xosc_lateral.files.openscenario.distribution import read_distribution
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.replay import STOP_TRIGGER
from xosc_lateral.files.tables import TABLE_SUFFIXES
from xosc_lateral.workflows.batch.request import SCENARIO_SUFFIX, DocumentKind, Request, concrete, document_kind
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.convert import carried_out, conversion_of
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.conversion.plan import chosen_egos, decide
from xosc_lateral.workflows.conversion.prepared import prepare
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.result import given_drives
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, made_vehicle
from xosc_lateral.world.player.player import play


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """Scenes that are counted together, made one after another, and the files that they come from."""

    label: str
    scenes: Callable[[], Iterator[Scene]]
    files: tuple[Path, ...] = ()
    told_lines: dict[str, None] = field(default_factory=dict)  # what reading them told, a line each, in order

    def is_same(self, other: Source) -> bool:
        """Whether both are the same scenes."""
        return self.label == other.label and {*map(Path.resolve, self.files)} == {*map(Path.resolve, other.files)}


@dataclass(frozen=True, eq=False, slots=True)
class SourceSettings:
    """How sources are read; `variants` lifelike ones of each scenario with each of the profiles, beside it."""

    convert: ConvertSettings = field(default_factory=ConvertSettings)
    variants: int = 0
    profiles: tuple[str, ...] = ()
    ego: str | None = None  # None: as found in a scenario; "none": there is none
    road: Path | None = None
    columns: TableMapping = field(default_factory=lambda: as_mapping(None))
    held: Held | None = None  # a scenario in memory
    sensor: Sensor = PERFECT_SENSOR  # through which detectors see
    kind: str | None = None  # format of a recording; None: as its file shows

    def on(self, road: Path | None, held: Held | None = None) -> SourceSettings:
        """The same, with a road that counts whatever a scenario says."""
        return replace(self, convert=replace(self.convert, road=road), road=road, held=held)

    def views(self, scene: Scene, *, with_observers: bool = True) -> list[View]:
        """What detectors see of a scene."""
        return views_of(scene, self.sensor, self.convert.seed, with_observers=with_observers)


def sources_of(path: Path, settings: SourceSettings) -> list[Source]:
    """Sources that a path stands for: one, or with lifelike variants one more for each profile.

    Raises `FormatError`, `NotEnoughDataError`: there is nothing of that name, or nothing in it.
    """
    if not exists(path):
        raise FormatError(absent(path), path=path)
    scenarios = _scenarios(path)
    if not scenarios:
        return [_measured(path, settings)]
    base = path if path.is_dir() else path.parent
    named = list(_named(scenarios, base, settings.convert))
    files = tuple(dict.fromkeys((*scenarios, *(each[0] for each in named))))
    sources = [Source(path.stem, partial(_written, named, settings), files)]
    profiles = settings.profiles if settings.variants else ()
    made = {profile: partial(_lifelike, named, profile, settings) for profile in profiles}
    return [*sources, *(Source(f"{path.stem}, {profile}", scenes, files) for profile, scenes in made.items())]


Named: TypeAlias = tuple[Path, str, ConvertSettings, int]
"""A scenario, what it is called, its settings with the values of its parameters, and the number of that set."""


def _scenarios(path: Path) -> list[Path]:
    """Scenarios and parameter distributions; in a folder, no scenario that a distribution beside it varies."""
    if not path.is_dir():
        return [path] if path.name.lower().endswith(SCENARIO_SUFFIX) else []
    kinds = {one: document_kind(one) for one in sorted(path.rglob(f"*{SCENARIO_SUFFIX}")) if one.is_file()}
    varied = {read_distribution(one).scenario_file.resolve()
              for one, kind in kinds.items() if kind is DocumentKind.DISTRIBUTION}  # fmt: skip
    return [one for one, kind in kinds.items() if kind is not DocumentKind.CATALOG and one.resolve() not in varied]


def _named(scenarios: Sequence[Path], base: Path, convert: ConvertSettings) -> Iterator[Named]:
    """Each scenario, and each set of parameters of a distribution."""
    for path in scenarios:
        name = path.relative_to(base).with_suffix("").as_posix()
        sets = concrete(Request(path, convert), document_kind(path))
        for number, (scenario, suffix, settings, why) in enumerate(sets):
            if why:
                raise FormatError(why)
            yield scenario, f"{name}{suffix}", settings, number


def _measured(path: Path, settings: SourceSettings) -> Source:
    is_table = (path.is_dir() or path.name.lower().endswith(TABLE_SUFFIXES)) and (
        settings.kind or format_of(path)
    ) == "tracks"
    told_lines = dict[str, None]()
    if is_table and settings.road is None:
        read = partial(_driven, path, settings, told_lines)
    else:
        read = partial(_recorded, path, settings, told_lines)
    return Source(path.name.split(".")[0], read, (path,), told_lines)


# ---- scenarios -------------------------------------------------------------------------------------------------------
def _written(named: Sequence[Named], settings: SourceSettings) -> Iterator[Scene]:
    """Each scenario as it is."""
    for scenario, name, convert, _ in named:
        played = play_scenario(scenario, parameters=convert.parameters, step=STEP, time_limit=convert.time_limit,
                               allowed=convert.allow, roads=convert.roads)  # fmt: skip
        yield played_scene(played, name, settings.ego)


def _lifelike(named: Sequence[Named], profile: str, settings: SourceSettings) -> Iterator[Scene]:
    """Each scenario's variants, converted and played as what is written plays."""
    ego = None if settings.ego is None else frozenset({settings.ego} - {"none"})
    for scenario, name, requested, number in named:
        convert = replace(requested, profile=profile, ego=ego)
        for variant in range(settings.variants):
            index = number * settings.variants + variant  # each set has offsets of its own
            yield converted(scenario, convert, index, f"{name} #{variant + 1}", settings.ego, cluster=name)[1]


def converted(
    scenario: Path, convert: ConvertSettings, index: int, name: str, ego: str | None, *, cluster: str = ""
) -> tuple[Conversion, Scene]:
    """The variant of a number, from 0, in memory, and tracks as what is written plays; see `played_scene`."""
    prepared = prepare(scenario, convert)
    plan = decide(prepared, convert, output=scenario, variant_index=index, saves=False)
    written = carried_out(plan)
    made, played = conversion_of(plan, written), written.played
    if played is None or played.motion.step != STEP or played.motion.ended_by != STOP_TRIGGER:
        read = read_scenario(scenario, allowed=convert.allow, roads=convert.roads, data=made.data)
        run = play(read, prepared.played.network, step=STEP, time_limit=convert.time_limit)
        played = Played(read, prepared.played.network, run)
    return made, played_scene(played, name, ego or next(iter(made.provenance.ego), "none"), cluster=cluster)


def played_scene(played: Played, name: str, ego: str | None, *, cluster: str = "") -> Scene:
    """Tracks of a scenario's vehicles. `ego`: None: its vehicle under test, if it has one; "none": there is none."""
    vehicles = [entity for entity in played.motion.entities if entity.entity.is_vehicle]
    vehicles = [entity for entity in vehicles if entity.name not in played.trailers]
    if ego is None:
        ego = next(iter(chosen_egos(played.scenario, ConvertSettings())), "none")
    elif ego != "none" and ego not in {entity.name for entity in vehicles}:
        raise FormatError(f"has no vehicle {ego!r} to be the ego", path=played.scenario.path)
    tracks, lanes = list[LaneTrack](), RoadLanes(played.network)
    for entity in vehicles:
        there = np.flatnonzero(((entity.activity & Activity.ACTIVE) != 0) & (entity.road >= 0))
        if len(there) > 1:
            tracks += tracks_of(in_lanes(entity.at(there), lanes), cluster=f"{cluster or name}:{entity.name}")
    names = tuple(entity.name for entity in played.motion.entities)
    return Scene(name, tuple(tracks), None if ego == "none" else ego, played.network, names)


# ---- measured traffic ------------------------------------------------------------------------------------------------
def _driven(path: Path, settings: SourceSettings, told_lines: dict[str, None]) -> Iterator[Scene]:
    tables = given_drives(path, settings.columns)
    told_lines |= dict.fromkeys(tables.evidence())
    return drive_scenes(tables.drives)


def _recorded(path: Path, settings: SourceSettings, told_lines: dict[str, None]) -> Iterator[Scene]:
    """Tracks of several vehicles, a scene for each recording."""
    for traffic in read_recordings(path, kind=settings.kind, road=settings.road, columns=settings.columns):
        told_lines |= dict.fromkeys(traffic.notes)
        yield _scene_of(traffic, path, settings)


def _scene_of(traffic: RecordedTraffic, path: Path, settings: SourceSettings) -> Scene:
    first, last = traffic.span
    recording = place_tracks(traffic.tracks, traffic.network, first, last)
    ego = None if settings.ego == "none" else settings.ego
    if ego is not None and ego not in {vehicle.name for vehicle in recording.vehicles}:
        raise FormatError(f"has no vehicle {ego!r} to be the ego", path=path)
    tracks, lanes = list[LaneTrack](), RoadLanes(traffic.network)
    for vehicle in recording.vehicles:
        motion = in_lanes(vehicle, lanes)
        motion = motion.having(following=motion.following & (vehicle.way() > 0))
        tracks += tracks_of(motion, cluster=vehicle.name)
    name = f"{traffic.name} {traffic.label}" if traffic.label else traffic.name
    return Scene(name, tuple(tracks), ego, traffic.network)


def drive_scenes(drives: Sequence[Drive]) -> Iterator[Scene]:
    """Each drive of a table, alone: the lane is where its markings are."""
    for drive in drives:
        n = len(drive)
        context, nothing = drive.context, np.full(n, np.nan)
        speed = context.get("speed", nothing)
        index, count = context.get("lane_index", nothing), context.get("lane_count", nothing)
        truck = context.get("is_truck", nothing)
        kind = "truck" if np.isfinite(truck).any() and np.nanmean(truck) > 0.5 else ""
        length = USUAL_LENGTH.get(kind, 4.6)
        car = made_vehicle(drive.name, length, USUAL_WIDTH.get(kind, 2.0 * HALF_WIDTH), REAR_AXLE * length)
        motion = EntityMotion.of(
            car, drive.time, offset=drive.offset, lane_width=drive.lane_width, speed=speed, lane_index=index,
            lane_count=count, following=np.isnan(speed) | (speed >= MINIMUM_SPEED * (1.0 - 1e-6)),
        )  # fmt: skip
        cuts = [] if drive.run is None else (np.flatnonzero(np.diff(drive.run)) + 1).tolist()
        tracks = tuple(tracks_of(motion, cluster=drive.name, cuts=cuts))
        if tracks:
            yield Scene(drive.name, tracks)


def checked(source: Source) -> Iterator[Scene]:
    """Its scenes; raises `NotEnoughDataError` where there are none."""
    count = 0
    for scene in source.scenes():
        count += bool(scene.tracks)
        yield scene
    if not count:
        raise NotEnoughDataError(f"{source.label}: no vehicle drives for 5 s without a gap")
