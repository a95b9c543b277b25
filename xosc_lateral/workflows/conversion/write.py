"""An output of a plan: trajectories, and chains of moves beside maneuvers that stay, with all that made them.

A vehicle that keeps its maneuvers has a chain from its start, and one after each action that moves it sideways.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.own_clock import way_of
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.files.openscenario.provenance import PENDING_HASH
from xosc_lateral.files.openscenario.write.build import version_text
from xosc_lateral.files.openscenario.write.draft import WrittenScenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.openscenario.write.lane_offset_scenario import LateralAction
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.conversion.plan import Plan, WrittenAs
from xosc_lateral.workflows.conversion.result import (
    ConversionProvenance,
    Enriched,
    EntityResult,
    EventShift,
    SampledSegment,
)
from xosc_lateral.workflows.conversion.settings import OutputMode, relative
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.offset_chain import GRID, OFFSET_DECIMALS, OffsetChain, OffsetPath, Ring, ring_along
from xosc_lateral.world.motion.trajectory import (
    SETTLING_TIME,
    NaturalSpline,
    SampledDeviation,
    deviation_through,
    distance_driven,
    settle,
    smoother_step,
)
from xosc_lateral.world.road.network import RoadNetwork

LONGEST_TURN = 300.0
"""Of a ring: a run that is stopped by something that never happens lasts an hour. [s]"""
ROAD_END_MARGIN = 20.0
"""A path ends so far before its road: what lies beyond has no place. [m]"""
LEAST_PATH_LENGTH = 60.0
"""A shorter path is none; in its last so many metres it is led to where a ring begins. [m]"""
CHORD_ERROR = 0.002
"""By which straight pieces may cut a bend. [m]"""
LEAST_GAP = 1.0
"""Between vertices. [m]"""
FOLLOW_ON_TIME = 0.1
"""A segment that begins within this after an action ends begins because of it. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class Written:
    """An output: the movement in it, how its vehicles were to be written, what is in the file."""

    movement: Enriched  # as sampled; of a reactive output that was checked, as it is played
    vehicles: WrittenAs
    chains: tuple[OffsetChain, ...]  # of those that keep their maneuvers
    provenance: ConversionProvenance
    file: WrittenScenario
    shifts: tuple[EventShift, ...] = ()
    warnings: tuple[str, ...] = ()  # of the check

    @property
    def with_lane_offsets(self) -> frozenset[str]:
        """Those that have a chain, of those that were to."""
        return frozenset(chain.entity for chain in self.chains)


def write(plan: Plan, sampled: Enriched) -> Written:
    """Write the output: a replay to its place; a reactive one into memory, since it is still to be checked."""
    vehicles = plan.written_as(frozenset(entity.name for entity in sampled.entities if entity.is_enriched))
    folder, driven = plan.source.parent, {one.name for one in sampled.entities if one.profile}
    provenance = ConversionProvenance(
        package_version=__version__,
        behaviour=BEHAVIOUR,
        scenario=f"{relative(folder, plan.output.parent)}/{plan.source.name}",
        inputs={relative(path, folder): sha256 for path, sha256 in plan.inputs.items()},
        profiles={
            name: (one.name, profile_hash(one))
            for name, one in plan.drivers.items()
            if name in driven and not isinstance(one, str)
        },
        options=plan.settings.record(folder),
        variant=plan.variant_index + 1,
        version=version_text(plan.version),
        ego=tuple(plan.egos),
        modes={},
        content_sha256=PENDING_HASH,
    )
    reactive = (entity for entity in sampled.entities if entity.name in vehicles.lane_offsets)
    chains = [chain for entity in reactive for chain in _chains_of(entity, plan)]
    return write_with(chains, plan, sampled, vehicles, provenance)


def write_with(
    chains: Sequence[OffsetChain], plan: Plan, sampled: Enriched, vehicles: WrittenAs, provenance: ConversionProvenance
) -> Written:
    """Write the output with these chains for those who get lane offsets."""
    modes = dict.fromkeys((chain.entity for chain in chains), OutputMode.LANE_OFFSET.value)
    modes |= dict.fromkeys(vehicles.trajectories, OutputMode.TRAJECTORY.value)
    enriched = sorted(entity.name for entity in sampled.entities if entity.is_enriched)
    modes = {name: modes[name] for name in enriched if name in modes}
    provenance = replace(provenance, modes=modes, content_sha256=PENDING_HASH)
    names = ", ".join(sorted({name for name, _ in provenance.profiles.values()})) or "no profile"
    sensor = ", with sensor" if plan.settings.with_sensor else ""
    file = write_converted(
        plan.extended.scenario,
        plan.extended.motion,
        {one.name: one.trajectory for one in sampled.entities if one.name in vehicles.trajectories},
        plan.output,
        chains=None if plan.is_replay else chains,
        lateral=plan.lateral,
        provenance={field.name: getattr(provenance, field.name) for field in fields(provenance)},
        summary=f"seed {plan.settings.seed}, variant {provenance.variant}, {names}{sensor}",
        save=plan.saves and plan.is_replay,
        target=plan.settings.target,
    )
    provenance = replace(provenance, content_sha256=file.content_sha256)
    return Written(sampled, vehicles, tuple(chains), provenance, file)


def _chains_of(entity: EntityResult, plan: Plan) -> list[OffsetChain]:
    """Chains of one entity, each with the offsets that it has in the nominal run then, or else with its longest ones.

    Whoever tows a trailer starts where it is written: put down aside, the trailer would swing. Where something changes
    its speed, an entity begins with a path by the distance driven.
    """
    motion, network = plan.played.motion, plan.played.network
    actions = plan.lateral.by_entity.get(entity.name, ())
    tows = entity.name in plan.played.trailers.values()
    is_there = bool(entity.motion.activity[0] & Activity.ACTIVE)
    add_action_path = next((action.path for action in actions if action.adds and not is_there), None)
    longest = max(entity.segments, key=_length)
    first_segment = next(_in_phase(entity, motion, add_action_path, actions), None)
    starts_aside = first_segment is not None and first_segment.span.first == 0 and not tows
    ring = _ring(first_segment or longest, from_middle=not starts_aside)
    path = None
    if entity.name in plan.lateral.changing_speed and not tows:
        path = _path(entity, motion, network, actions, ring.origin)
    side, start_t = 1.0, None
    if starts_aside or path is not None:
        side, middle_t = _middle(entity, network)
        start_t = middle_t + side * (ring.origin if path is None else path.offset[0])
    is_steered = bool(entity.motion.activity[0] & Activity.STEERED)
    chains = [] if is_steered else [OffsetChain(entity.name, add_action_path, ring, start_t, side, path)]
    for action in actions:
        if not action.adds and not action.steers:
            segment = max(_in_phase(entity, motion, action.path, actions), key=_length, default=longest)
            chains.append(OffsetChain(entity.name, action.path, _ring(segment, from_middle=True)))
    return [chain for chain in chains if chain.ring.moves]


def _length(segment: SampledSegment) -> float:
    return segment.span.end - segment.span.start


def _in_phase(
    entity: EntityResult, motion: NominalMotion, after: tuple[str, ...] | None, actions: Collection[LateralAction]
) -> Iterator[SampledSegment]:
    """Segments between the end of an action in the nominal run and the next lateral action."""
    paths = {action.path for action in actions if not action.adds}
    starts = [one.start for one in motion.actions if one.actor == entity.name and one.path in paths]
    ends = [one.end for one in motion.actions if one.path == after and one.end is not None]
    begin = 0.0 if after is None else min(ends, default=np.inf)
    until = min((start for start in starts if start > begin + FOLLOW_ON_TIME), default=np.inf)
    return (segment for segment in entity.segments if begin - FOLLOW_ON_TIME <= segment.span.start < until)


def _ring(segment: SampledSegment, *, from_middle: bool) -> Ring:
    """Along what was sampled, with what was sampled beyond the segment's end."""
    offset = np.append(segment.offset, segment.beyond)
    time = np.append(segment.time, segment.time[-1] + STEP * np.arange(1, len(segment.beyond) + 1)) - segment.time[0]
    goes_on = np.diff(time, prepend=-1.0) > 0.0
    time, offset = time[goes_on], offset[goes_on]
    grid = np.arange(0.0, min(float(time[-1]), LONGEST_TURN), GRID)
    path: FloatArray = NaturalSpline.natural(time, offset)(grid)
    return ring_along(grid, path, from_middle=from_middle)


def _path(
    entity: EntityResult, motion: NominalMotion, network: RoadNetwork, actions: Collection[LateralAction], end: float
) -> OffsetPath | None:
    """From the start along what was sampled, to the offset `end` [m]; on one road, where each vertex has its place."""
    vehicle, paths = entity.motion, {action.path for action in actions}
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
    room = (length - float(vehicle.s[0]) if side > 0.0 else float(vehicle.s[0])) - ROAD_END_MARGIN
    reach = min(room, float(parts[-1].distance[-1]))
    if reach < LEAST_PATH_LENGTH:
        return None
    at = _vertices(vehicle, network, driven, last, reach)
    through = deviation_through(parts)
    begin = through(np.array([0.0, LEAST_GAP]))
    offset = through(at) - settle(at, LEAST_PATH_LENGTH, float(np.diff(begin)[0]) / LEAST_GAP, 0.0)
    share = smoother_step((at - reach + LEAST_PATH_LENGTH) / LEAST_PATH_LENGTH)
    offset += share * (end - offset)
    return OffsetPath(tuple(np.round(at, 3).tolist()), tuple(np.round(offset, OFFSET_DECIMALS).tolist()))


def _sampled(segment: SampledSegment, vehicle: EntityMotion, driven: FloatArray, *, is_last: bool) -> SampledDeviation:
    """One segment by the distance driven, the last one with what was sampled beyond it, at the speed of its end."""
    offset, distance = segment.offset, segment.distance
    if distance is None:
        distance = np.interp(segment.time, vehicle.time, driven)
    speeds = vehicle.speed[[segment.span.first, segment.span.last]]
    if is_last:
        step = STEP * float(way_of(speeds[1:])[0])
        distance = np.append(distance, distance[-1] + step * np.arange(1, len(segment.beyond) + 1))
        offset = np.append(offset, segment.beyond)
    settling = SETTLING_TIME * speeds
    return SampledDeviation(distance, offset, (float(settling[0]), float(settling[1])))


def _vertices(vehicle: EntityMotion, network: RoadNetwork, driven: FloatArray, last: int, reach: float) -> FloatArray:
    """Distances of vertices: every 0.1 s as it is driven nominally, closer in bends, never below 1 m. [m]"""
    rows = np.arange(0, last, max(1, round(GRID / (vehicle.time[1] - vehicle.time[0]))))
    bend = np.abs(network.lane_curvature(vehicle.road[rows], vehicle.lane[rows], vehicle.s[rows]))
    gap = np.minimum(GRID * np.abs(vehicle.speed[rows]), np.sqrt(8.0 * CHORD_ERROR / np.maximum(bend, 1e-6)))
    gap, distances = np.clip(gap, LEAST_GAP, None), [0.0]
    while distances[-1] < reach:
        distances.append(distances[-1] + float(np.interp(distances[-1], driven[rows], gap)))
    kept = -1 if reach - distances[-2] > 0.5 * LEAST_GAP else -2
    return np.append(distances[:kept], reach)


def _middle(entity: EntityResult, network: RoadNetwork) -> tuple[float, float]:
    """+1 where +t is to an entity's left at its begin, else -1; its place there along +t from the lane's centre [m]."""
    motion = entity.motion
    direction = float(network.travel_directions(motion.road[:1], motion.lane[:1])[0])
    along_lane = 1.0 if np.cos(motion.heading_relative[0]) >= 0.0 else -1.0
    return direction * along_lane, direction * float(motion.offset[0])
