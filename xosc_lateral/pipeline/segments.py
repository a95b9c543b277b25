"""Road-following segments of a played scenario, as a table of plain values."""

from __future__ import annotations

from xosc_lateral.motion.segments import SegmentRow, cut_segments
from xosc_lateral.pipeline.load import Played


def scenario_segments(played: Played) -> tuple[SegmentRow, ...]:
    """All segments of all entities, in the scenario's order and in order of time."""
    rows = []
    for motion in played.motion.entities:
        for span in cut_segments(motion, played.network, is_trailer=motion.name in played.trailers):
            index = int(motion.road[span.first])
            rows.append(
                SegmentRow(
                    entity=motion.name,
                    start=span.start,
                    end=span.end,
                    road_following=span.is_road_following,
                    why="" if span.is_road_following else span.kind.value,
                    road=played.network.road_ids[index] if index >= 0 else "",
                    lane=int(motion.lane[span.first]) if index >= 0 else 0,
                )
            )
    return tuple(rows)
