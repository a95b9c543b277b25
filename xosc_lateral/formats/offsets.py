"""Tables of sampled offsets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from xosc_lateral.driver.sampled_offsets import SampledOffsets


def offset_columns(sampled: Sequence[SampledOffsets], *, snippets: bool) -> dict[str, Any]:
    """Columns ``drive, snippet, time, offset, offset_real`` of snippets, else ``drive, time, offset``. [s], [m]"""
    lengths = [len(item.time) for item in sampled]
    columns: dict[str, Any] = {"drive": [item.drive for item in sampled for _ in range(len(item.time))]}
    if snippets:
        columns["snippet"] = np.repeat(np.array([item.snippet for item in sampled], dtype=np.int64), lengths)
    columns["time"] = np.concatenate([item.time for item in sampled])
    columns["offset"] = np.concatenate([item.offset for item in sampled])
    if snippets:
        columns["offset_real"] = np.concatenate([item.offset_real for item in sampled if item.offset_real is not None])
    return columns
