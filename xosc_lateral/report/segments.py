"""Segments as text and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # results point up to reports, never the other way round at run time
    from xosc_lateral.pipeline.segments import SegmentRow


def as_text(rows: Sequence[SegmentRow]) -> str:
    """One line per stretch."""
    width = max((len(row.entity) for row in rows), default=0)
    return "\n".join(
        f"{row.entity:<{width}}  {row.start:8.2f} - {row.end:8.2f} s  "
        + (f"road {row.road} lane {row.lane}: road-following" if row.road_following else f"no: {row.why}")
        for row in rows
    )


def to_json(rows: Sequence[SegmentRow]) -> str:
    """A list of objects."""
    return json.dumps([asdict(row) for row in rows], indent=1)
