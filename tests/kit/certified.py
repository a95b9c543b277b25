"""The drives that the certified files of version 0.1 were sampled on; see tests/data/certified/README.md."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.base.segment import Segment

FOLDER = Path(__file__).resolve().parents[1] / "data" / "certified"
MODELS = ("two-level", "best")
KINDS = ("bare", "effects", "paced")
SEED = 20261121
START = 0.23
STEP = 0.2
RATE = 50.0
STEPS_BEFORE_STATE = 433
"""Calls of `OffsetStream.step` after which the state was saved; the next one continues within a model step."""


def contexts(n: int, step: float = STEP) -> dict[str, np.ndarray]:
    """Columns of every kind: steady, with gaps, with levels, an angle."""
    time = np.arange(n) * step
    lead = 60.0 + 40.0 * np.sin(time / 7.0)
    return {
        "speed": 30.0 + 4.0 * np.sin(time / 11.0),
        "lane_width": 3.5 + 0.2 * np.sin(time / 31.0),
        "curvature": 1e-3 * np.sin(time / 5.0),
        "lead_distance": np.where(lead > 80.0, np.nan, lead),
        "right_distance": np.where(np.sin(time / 9.0) > 0.3, 12.0, np.nan),
        "lane_index": np.floor(time / 20.0) % 3,
        "wind_speed": 8.0 + 3.0 * np.cos(time / 40.0),
        "wind_direction": (15.0 * time) % 360.0,
    }


def segments() -> list[Segment]:
    """A drive in two pieces, with a lane change of 5 s between them and context around both."""
    columns = contexts(900)
    time = 3.0 + STEP * np.arange(900)
    pieces = ((0, 400, 40, 20), (405, 900, 60, 0))
    return [
        Segment(
            time[first:last],
            columns["lane_width"][first:last],
            columns["speed"][first:last],
            {name: values[first:last] for name, values in columns.items()},
            before,
            after,
        )
        for first, last, before, after in pieces
    ]


def rows(columns: dict[str, np.ndarray]) -> list[dict[str, float]]:
    """Column by column as one mapping a row."""
    return [{name: float(values[row]) for name, values in columns.items()} for row in range(len(columns["speed"]))]
