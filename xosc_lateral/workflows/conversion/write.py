"""An output of a plan: trajectories, and chains of moves beside maneuvers that stay, with all that made them.

A vehicle that keeps its maneuvers has a chain from its start, and one after each action that moves it sideways.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.files.openscenario.provenance import PENDING
from xosc_lateral.files.openscenario.write.build import named
from xosc_lateral.files.openscenario.write.draft import WrittenScenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.openscenario.write.lateral_actions import LateralAction
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.conversion.plan import Plan, WrittenAs
from xosc_lateral.workflows.conversion.result import ConversionProvenance, Enriched, EntityResult, SampledSegment
from xosc_lateral.workflows.conversion.settings import OutputMode, relative
from xosc_lateral.world.motion.deviation import (
    SETTLING_TIME,
    NaturalSpline,
    SampledDeviation,
    deviation_through,
    settle,
    smoother_step,
)
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.offset_chain import GRID, RESOLUTION, OffsetChain, OffsetPath, Ring, ring_along
from xosc_lateral.world.motion.trajectory import distance_driven
from xosc_lateral.world.road.network import RoadNetwork

LONGEST_TURN = 300.0
"""Of a ring: a run that is stopped by something that never happens lasts an hour. [s]"""
ROAD_END = 20.0
"""A path ends so far before its road: what lies beyond has no place. [m]"""
LEAST_PATH = 60.0
"""A shorter path is none; in its last so many metres it is led to where a ring begins. [m]"""
CUT = 0.002
"""By which straight pieces may cut a bend. [m]"""
LEAST_GAP = 1.0
"""Between vertices. [m]"""
AT_ONCE = 0.1
"""A segment that begins within this after an action ends begins because of it. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class Written:
    """An output, how its vehicles were to be written, and the chains of those that keep their maneuvers."""

    vehicles: WrittenAs
    chains: tuple[OffsetChain, ...]
    provenance: ConversionProvenance
    file: WrittenScenario

    @property
    def with_lane_offsets(self) -> frozenset[str]:
        """Those that have a chain, of those that were to."""
        return frozenset(chain.entity for chain in self.chains)


def write(plan: Plan, sampled: Enriched) -> Written:
    """Write the output: a replay to its place, a reactive one into memory, since it is still to be checked."""
    vehicles = plan.written_as(frozenset(entity.name for entity in sampled.entities if entity.is_enriched))
    towing, played = plan.played.trailers.values(), plan.played
    chains = [
        chain
        for entity in sampled.entities
        if entity.name in vehicles.lane_offsets
        for chain in chains_of(
            entity,
            played.motion,
            played.network,
            plan.lateral.by_entity.get(entity.name, ()),
            tows=entity.name in towing,
            changes_speed=entity.name in plan.lateral.changing_speed,
        )
    ]
    return write_with(chains, plan, sampled, vehicles)


def write_with(chains: Sequence[OffsetChain], plan: Plan, sampled: Enriched, vehicles: WrittenAs) -> Written:
    """Write the output with these chains for those who get lane offsets."""
    on_trajectories = vehicles.trajectories
    modes = dict.fromkeys((chain.entity for chain in chains), OutputMode.LANE_OFFSET.value)
    modes |= dict.fromkeys(on_trajectories, OutputMode.TRAJECTORY.value)
    folder, drivers = plan.source.parent, {one.name: one.profile for one in sampled.entities if one.profile is not None}
    provenance = ConversionProvenance(
        package_version=__version__,
        behaviour=BEHAVIOUR,
        scenario=f"{relative(folder, plan.output.parent)}/{plan.source.name}",
        inputs={relative(path, folder): sha256 for path, sha256 in plan.inputs.items()},
        profiles={name: (profile.name, profile_hash(profile)) for name, profile in drivers.items()},
        options=plan.settings.record(folder),
        variant=plan.variant + 1,
        version=named(plan.version),
        ego=tuple(plan.egos),
        modes={name: mode for name, mode in sorted(modes.items()) if sampled.entity(name).is_enriched},
        content_sha256=PENDING,
    )
    names = ", ".join(sorted({name for name, _ in provenance.profiles.values()})) or "no profile"
    sensor = ", with sensor" if plan.settings.with_sensor else ""
    file = write_converted(
        plan.extended.scenario,
        plan.extended.motion,
        {one.name: one.trajectory for one in sampled.entities if one.name in on_trajectories},
        plan.output,
        chains=None if plan.is_replay else chains,
        lateral=plan.lateral,
        provenance={field.name: getattr(provenance, field.name) for field in fields(provenance)},
        summary=f"seed {plan.settings.seed}, variant {provenance.variant}, {names}{sensor}",
        save=plan.saves and plan.is_replay,
        target=plan.settings.target,
    )
    return Written(vehicles, tuple(chains), replace(provenance, content_sha256=file.content_sha256), file)


def chains_of(
    entity: EntityResult,
    motion: NominalMotion,
    network: RoadNetwork,
    items: Collection[LateralAction],
    *,
    tows: bool,
    changes_speed: bool,
) -> list[OffsetChain]:
    """Chains of one entity, each with the offsets that it has in the nominal run then, or else with its longest ones.

    Who `tows` a trailer is not put down beside the middle: the trailer would swing. Where something `changes_speed`, it
    begins with a path by the distance driven.
    """
    longest = max(entity.segments, key=_length)
    added = next((item.path for item in items if item.adds and not _is_there_at_start(entity)), None)
    first = next(iter(_in_phase(entity, motion, added, items)), None)
    is_placed = first is not None and first.span.first == 0 and not tows
    ring = _ring(first or longest, from_middle=not is_placed)
    path = _path(entity, motion, network, items, ring.origin) if changes_speed and not tows else None
    is_placed = is_placed or path is not None
    side, middle_t = _middle(entity, network) if is_placed else (1.0, 0.0)
    begin = ring.origin if path is None else path.offset[0]
    placed = middle_t + side * begin if is_placed else None
    is_steered = bool(entity.motion.activity[0] & Activity.STEERED)
    chains = [] if is_steered else [OffsetChain(entity.name, added, ring, placed, side, path)]
    for item in items:
        if not item.adds and not item.steers:
            segment = max(_in_phase(entity, motion, item.path, items), key=_length, default=longest)
            chains.append(OffsetChain(entity.name, item.path, _ring(segment, from_middle=True)))
    return [chain for chain in chains if chain.ring.moves]


def _is_there_at_start(entity: EntityResult) -> bool:
    return bool(entity.motion.activity[0] & Activity.ACTIVE)


def _length(segment: SampledSegment) -> float:
    return segment.span.end - segment.span.start


def _in_phase(
    entity: EntityResult, motion: NominalMotion, after: tuple[str, ...] | None, items: Collection[LateralAction]
) -> Iterator[SampledSegment]:
    """Segments between the end of an action in the nominal run and the next lateral action."""
    paths = {item.path for item in items if not item.adds}
    played = [one for one in motion.actions if one.actor == entity.name and one.path in paths]
    ends = [one.end for one in motion.actions if one.path == after and one.end is not None]
    begin = 0.0 if after is None else min(ends, default=np.inf)
    until = min((one.start for one in played if one.start > begin + AT_ONCE), default=np.inf)
    for segment in entity.segments:
        if begin - AT_ONCE <= segment.span.start < until:
            yield segment


def _ring(segment: SampledSegment, *, from_middle: bool) -> Ring:
    """Along what was sampled, with what was sampled beyond the segment's end."""
    offset = np.append(segment.offset, segment.beyond)
    time = (segment.time[1] - segment.time[0]) * np.arange(len(offset))
    grid = np.arange(0.0, min(float(time[-1]), LONGEST_TURN), GRID)
    path: FloatArray = NaturalSpline.natural(time, offset)(grid)
    return ring_along(grid, path, from_middle=from_middle)


def _path(
    entity: EntityResult, motion: NominalMotion, network: RoadNetwork, items: Collection[LateralAction], end: float
) -> OffsetPath | None:
    """From the start along what was sampled before the first lateral action and beyond it, to some offset. [m]

    On one road alone, up to shortly before its end, where the place of each vertex is certain.
    """
    vehicle, paths = entity.motion, {item.path for item in items}
    starts = [one.start for one in motion.actions if one.actor == entity.name and one.path in paths]
    until = min(starts, default=np.inf)
    segments = [segment for segment in entity.segments if segment.span.start < until]
    last = int(np.searchsorted(vehicle.time, min(until, float(vehicle.time[-1]))))
    rows = slice(0, last)
    is_here = ((vehicle.activity[1:last] & (Activity.ACTIVE | Activity.TELEPORTED)) == Activity.ACTIVE).all()
    if not segments or last < 2 or not is_here or len(set(vehicle.road[rows].tolist())) != 1 or vehicle.road[0] < 0:
        return None
    driven = distance_driven(vehicle)
    parts = [_sampled(segment, vehicle, driven, is_last=segment is segments[-1]) for segment in segments]
    side, _ = _middle(entity, network)
    length = network.roads[int(vehicle.road[0])].length
    room = (length - float(vehicle.s[0]) if side > 0.0 else float(vehicle.s[0])) - ROAD_END
    reach = min(room, float(parts[-1].distance[-1]))
    if reach < LEAST_PATH:
        return None
    at = _vertices(vehicle, network, driven, last, reach)
    through = deviation_through(parts)
    begin = through(np.array([0.0, LEAST_GAP]))
    offset = through(at) - settle(at, LEAST_PATH, float(np.diff(begin)[0]) / LEAST_GAP, 0.0)
    share = smoother_step((at - reach + LEAST_PATH) / LEAST_PATH)
    offset += share * (end - offset)
    return OffsetPath(tuple(np.round(at, 3).tolist()), tuple(np.round(offset, RESOLUTION).tolist()))


def _sampled(segment: SampledSegment, vehicle: EntityMotion, driven: FloatArray, *, is_last: bool) -> SampledDeviation:
    """One segment by the distance driven, the last one with what was sampled beyond it, at the speed of its end."""
    distance, offset = np.interp(segment.time, vehicle.time, driven), segment.offset
    speeds = vehicle.speed[[segment.span.first, segment.span.last]]
    if is_last:
        step = float(speeds[1]) * (segment.time[1] - segment.time[0])
        distance = np.append(distance, distance[-1] + step * np.arange(1, len(segment.beyond) + 1))
        offset = np.append(offset, segment.beyond)
    settling = SETTLING_TIME * speeds
    return SampledDeviation(distance, offset, (float(settling[0]), float(settling[1])))


def _vertices(vehicle: EntityMotion, network: RoadNetwork, driven: FloatArray, last: int, reach: float) -> FloatArray:
    """Distances of vertices: every 0.1 s as it is driven nominally, closer in bends, never below 1 m. [m]"""
    rows = np.arange(0, last, max(1, round(GRID / (vehicle.time[1] - vehicle.time[0]))))
    bend = np.abs(network.lane_curvature(vehicle.road[rows], vehicle.lane[rows], vehicle.s[rows]))
    gap = np.minimum(GRID * np.abs(vehicle.speed[rows]), np.sqrt(8.0 * CUT / np.maximum(bend, 1e-6)))
    gap, distances = np.clip(gap, LEAST_GAP, None), [0.0]
    while distances[-1] < reach:
        distances.append(distances[-1] + float(np.interp(distances[-1], driven[rows], gap)))
    return (
        np.append(distances[:-1], reach)
        if reach - distances[-2] > 0.5 * LEAST_GAP
        else np.append(distances[:-2], reach)
    )


def _middle(entity: EntityResult, network: RoadNetwork) -> tuple[float, float]:
    """Where an entity begins: +1 where +t is to its left, else -1; its nominal place along +t from the lane's centre.

    [m]
    """
    motion = entity.motion
    direction = float(network.travel_directions(motion.road[:1], motion.lane[:1])[0])
    along_lane = 1.0 if np.cos(motion.heading_relative[0]) >= 0.0 else -1.0
    return direction * along_lane, direction * float(motion.offset[0])
