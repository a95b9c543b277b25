"""A driver of right-hand traffic on a road with left-hand traffic, and the other way round: as seen in a mirror.

What a driver does to the left there is done to the right here: the overtaking lane, the hard shoulder and the seat have
changed sides. So the context is mirrored, the profile sampled in it, and its offsets are mirrored back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

OTHER_SIGN = ("curvature", "crossfall")
"""Positive to the one side, negative to the other."""

_SIDES = {"left": "right", "right": "left"}


def mirrored(segment: Segment) -> Segment:
    """The segment with left and right exchanged.

    Columns change places whose names differ in the word `left` or `right` alone (`left_distance`, `truck_right`);
    curvature and crossfall change their sign, the wind its side; lanes are counted from the other edge. A column of
    another name stays.
    """
    return replace(segment, context=mirrored_context(segment.context))


def mirrored_context(context: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Context columns with left and right exchanged; shapes and units as they are."""
    found = {other_side(name): values for name, values in context.items()}
    for name in OTHER_SIGN:
        if name in found:
            found[name] = -found[name]
    if "wind_direction" in found:
        found["wind_direction"] = -found["wind_direction"] % 360.0
    if "lane_index" in found and "lane_count" in found:
        found["lane_index"] = found["lane_count"] - 1.0 - found["lane_index"]
    return found


def other_side(name: str) -> str:
    """The name with the words `left` and `right` exchanged."""
    return "_".join(_SIDES.get(word, word) for word in name.split("_"))
