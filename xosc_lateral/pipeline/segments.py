"""Road-following segments of a played scenario, as a table of plain values."""

from __future__ import annotations

from xosc_lateral.motion.segments import SegmentRow, cut_stretches
from xosc_lateral.pipeline.load import Played


def scenario_segments(played: Played) -> tuple[SegmentRow, ...]:
    """All stretches of all entities, in the scenario's order and in order of time."""
    rows = []
    for motion in played.motion.entities:
        for stretch in cut_stretches(motion, played.network, is_trailer=motion.name in played.trailers):
            index = int(motion.road[stretch.first])
            rows.append(
                SegmentRow(
                    entity=motion.name,
                    start=stretch.start,
                    end=stretch.end,
                    road_following=stretch.is_road_following,
                    why="" if stretch.is_road_following else stretch.kind.value,
                    road=played.network.road_ids[index] if index >= 0 else "",
                    lane=int(motion.lane[stretch.first]) if index >= 0 else 0,
                )
            )
    return tuple(rows)
