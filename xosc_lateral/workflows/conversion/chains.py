"""From sampled offsets to chains of moves: one from the start, one after each action that moves an entity sideways."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.openscenario.write.lateral_actions import LateralAction
from xosc_lateral.workflows.conversion.result import EntityResult, SampledSegment
from xosc_lateral.world.motion.deviation import NaturalSpline
from xosc_lateral.world.motion.nominal import Activity, NominalMotion
from xosc_lateral.world.motion.offset_chain import GRID, OffsetChain, Ring, ring_along
from xosc_lateral.world.road import RoadNetwork

LONGEST_TURN = 300.0
"""Of a ring: a run that is stopped by something that never happens lasts an hour. [s]"""
AT_ONCE = 0.1
"""A segment that begins within this after an action ends begins because of it. [s]"""


def chains_of(
    entity: EntityResult,
    motion: NominalMotion,
    network: RoadNetwork,
    items: Collection[LateralAction],
    *,
    tows: bool,
) -> list[OffsetChain]:
    """Chains of one entity, each with the offsets that it has in the nominal run then, or else with its longest ones.

    Parameters
    ----------
    entity : EntityResult
    motion : NominalMotion
        Its run.
    network : RoadNetwork
    items : collection of LateralAction
        Its own.
    tows : bool
        It pulls a trailer, and is not put down beside the middle: the trailer would swing.
    """
    longest = max(entity.segments, key=_length)
    added = next((item.path for item in items if item.adds and not _is_there_at_start(entity)), None)
    first = next(iter(_in_phase(entity, motion, added, items)), None)
    is_placed = first is not None and first.span.first == 0 and not tows
    ring = _ring(first or longest, from_middle=not is_placed)
    side, middle_t = _middle(entity, network) if is_placed else (1.0, 0.0)
    chains = [OffsetChain(entity.name, added, ring, middle_t + side * ring.origin if is_placed else None, side)]
    for item in items:
        if not item.adds:
            found = max(_in_phase(entity, motion, item.path, items), key=_length, default=longest)
            chains.append(OffsetChain(entity.name, item.path, _ring(found, from_middle=True)))
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


def _middle(entity: EntityResult, network: RoadNetwork) -> tuple[float, float]:
    """Where an entity begins: +1 where +t is to its left, else -1; its nominal place along +t from the lane's centre.

    [m]
    """
    motion = entity.motion
    direction = float(network.travel_directions(motion.road[:1], motion.lane[:1])[0])
    along_lane = 1.0 if np.cos(motion.heading_relative[0]) >= 0.0 else -1.0
    return direction * along_lane, direction * float(motion.offset[0])
