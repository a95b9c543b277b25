"""What a reactive output does when it is played: what reports and summaries of a conversion state."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.workflows.conversion.consequences import gaps_of, lane_departures
from xosc_lateral.workflows.conversion.enrich import untouched
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.motion.trajectory import WorldTrajectory
from xosc_lateral.world.player.player import play
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.conditions import at_time

CHANGES = "with offsets, what happens would happen otherwise"


def read_written(data: bytes, output: Path, source: Scenario, settings: ConvertSettings) -> Scenario:
    """An output from its bytes, as seen from its place, with what its source was allowed to read."""
    roads = () if source.road_file is None else (source.road_file.parent,)
    allowed = (*settings.allow, *(path.parent for path in source.input_files), *roads)
    return read_scenario(output, allowed=allowed, roads=settings.roads, data=data)


def as_written(
    enriched: Enriched,
    lasting: Played,
    written: Scenario,
    run: NominalMotion,
    moved: Collection[str],
    left: Collection[str],
) -> Enriched:
    """The result with what is played in place of what was sampled, for entities that keep their maneuvers.

    Parameters
    ----------
    enriched : Enriched
        As sampled, for the run `lasting`.
    lasting : Played
    written : Scenario
        The output.
    run : NominalMotion
        Its nominal run, which may end earlier.
    moved : collection of str
        Entities that follow their maneuvers and move beside them.
    left : collection of str
        Entities that were to do so, and stay as they are.
    """
    motion = lasting.motion
    if run.end_time < motion.end_time - motion.step:
        storyboard = written.storyboard
        later = structs.replace(storyboard, stop_trigger=at_time(motion.end_time, "later", storyboard.place))
        longer, limit = replace(written, storyboard=later), motion.end_time + motion.step
        run = play(longer, lasting.network, step=motion.step, time_limit=limit)
    played = {entity.name: entity for entity in run.entities}
    entities = tuple(
        _measured(entity, played[entity.name])
        if entity.name in moved
        else untouched(entity.motion, entity.spans, CHANGES)
        if entity.name in left
        else entity
        for entity in enriched.entities
    )
    gaps_after = gaps_of(motion, [entity.trajectory for entity in entities])
    departures = tuple(found for entity in entities for found in lane_departures(entity, lasting.network))
    return replace(enriched, entities=entities, gaps_after=gaps_after, departures=departures)


def _measured(entity: EntityResult, played: EntityMotion) -> EntityResult:
    """One entity where it is when the output is played, held where that ends first."""
    motion = entity.motion
    rows = np.minimum(np.arange(len(motion.time)), len(played.time) - 1)
    x, y, z, heading, pitch, roll, speed = (
        np.asarray(getattr(played, name)[rows]) for name in ("x", "y", "z", "heading", "pitch", "roll", "speed")
    )
    deviation: FloatArray = (y - motion.y) * np.cos(motion.heading) - (x - motion.x) * np.sin(motion.heading)
    segments = tuple(
        replace(segment, offset=np.interp(segment.time, motion.time, deviation), beyond=np.empty(0))
        for segment in entity.segments
    )
    trajectory = WorldTrajectory(motion.time, x, y, z, heading, pitch, roll, speed)
    return replace(entity, segments=segments, deviation=deviation, trajectory=trajectory)
