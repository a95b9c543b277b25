"""Segments as text."""

from __future__ import annotations

from collections.abc import Sequence

from xosc_lateral.motion.segments import SegmentRow


def as_text(rows: Sequence[SegmentRow]) -> str:
    """One line per segment."""
    width = max((len(row.entity) for row in rows), default=0)
    return "\n".join(
        f"{row.entity:<{width}}  {row.start:8.2f} - {row.end:8.2f} s  "
        + (f"road {row.road} lane {row.lane}: road-following" if row.road_following else f"no: {row.why}")
        for row in rows
    )
