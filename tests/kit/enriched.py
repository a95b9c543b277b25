"""An enriched scenario made by hand: two cars and a van on a straight and an arc, one of them changing lanes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.kit.motion import drive, entity, together, two_roads
from xosc_lateral.base.note import Note
from xosc_lateral.base.note import warnings as as_warnings
from xosc_lateral.base.track import Track
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.result import ConversionProvenance, Enriched, EntityResult, SampledSegment
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.motion.gaps import Gap, smallest_gaps
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.segments import cut_segments
from xosc_lateral.world.motion.trajectory import displace
from xosc_lateral.world.road.network import RoadNetwork

DURATION = 30.0


def made_enriched(folder: Path, *, amplitude: float = 0.3, notes: tuple[Note, ...] = ()) -> Enriched:
    """`amplitude` [m]: of the slow sine by which the first two vehicles swerve; the third is not enriched."""
    network = two_roads(folder)
    motion = together(
        drive(network, entity("Ego"), lane=-2, speed=30.0, duration=DURATION),
        _lane_changer(network),
        drive(network, entity("Slow"), lane=-3, start=60.0, speed=9.0, duration=DURATION),
    )
    motion = replace(motion, actions=(), ended_by="stop trigger", notes=notes)
    entities = tuple(
        _swerving(each, network, amplitude * scale) if scale else _untouched(each, network)
        for each, scale in zip(motion.entities, (1.0, 0.7, 0.0), strict=True)
    )
    before = _gaps([(each.motion, each.motion) for each in entities])
    after = _gaps([(each.motion, each.trajectory) for each in entities])
    return Enriched(motion, network, entities, before, after, (), seed=1, variant=0, attempt=0)


def _lane_changer(network: RoadNetwork) -> EntityMotion:
    """In lane -3 at first, in lane -2 from 14 s on; the change takes 4 s, half of it in each lane."""
    time = np.arange(round(DURATION / 0.02) + 1) * 0.02
    done = np.clip((time - 12.0) / 4.0, 0.0, 1.0)
    moved = 3.5 * 0.5 * (1.0 - np.cos(np.pi * done))
    activity = np.full(len(time), int(Activity.ACTIVE), dtype=np.uint8)
    activity[(done > 0.0) & (done < 1.0)] |= int(Activity.LATERAL)
    right = drive(
        network, entity("Van"), lane=-3, start=120.0, speed=25.0, duration=DURATION, offset=moved, activity=activity
    )
    left = drive(
        network,
        entity("Van"),
        lane=-2,
        start=120.0,
        speed=25.0,
        duration=DURATION,
        offset=moved - 3.5,
        activity=activity,
    )
    late = done >= 0.5
    joined = {
        name: np.where(late, left.columns[name], right.columns[name])
        for name in ("x", "y", "z", "heading", "pitch", "roll", "lane", "s", "offset")
    }
    return right.having(**joined)


def _swerving(motion: EntityMotion, network: RoadNetwork, amplitude: float) -> EntityResult:
    deviation = amplitude * np.sin(2.0 * np.pi * motion.time / 10.0)
    spans = cut_segments(motion, network)
    segments = tuple(
        SampledSegment(each, motion.time[each.first : each.last + 1 : 10], deviation[each.first : each.last + 1 : 10])
        for each in spans
        if each.is_road_following
    )
    return EntityResult(motion, spans, None, "", segments, deviation, displace(motion, network, deviation))


def _untouched(motion: EntityMotion, network: RoadNetwork) -> EntityResult:
    spans = cut_segments(motion, network)
    return EntityResult(motion, spans, None, "below 40 km/h throughout", (), np.zeros(len(motion.time)), motion)


def _gaps(paths: list[tuple[EntityMotion, Track]]) -> tuple[Gap, ...]:
    return smallest_gaps([motion.having(x=path.x, y=path.y).at(slice(None, None, 5)) for motion, path in paths])


def converted(enriched: Enriched, *warnings: str) -> Conversion:
    """The same as a conversion of in.xosc into out.xosc."""
    options = ConvertSettings(seed=7, parameters={"speed": "30"}).record(Path())
    made = ConversionProvenance(
        "0.1", 1, "in.xosc", {"in.xosc": "a" * 64}, {"Ego": ("calm", "b" * 64)}, options, 2, "1.2", (), {}, "d" * 64
    )
    return Conversion(Path("in.xosc"), Path("out.xosc"), "c" * 64, enriched, made, as_warnings(warnings))
