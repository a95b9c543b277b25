"""Time near a marking, and how often a driver gets there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NEAR_MARKING = 1.2
"""A reference point this close to a marking counts as near: half a car (0.9 m) and 0.3 m of air. [m]"""


@dataclass(frozen=True)
class Margins:
    """How a driver uses the lane's margins.

    Parameters
    ----------
    share_near : float
        Share of time with the reference point within `NEAR_MARKING` of a marking. [-]
    excursions_per_hour : float
        How often that zone is entered. [1/h]
    largest : float
        Largest |offset|. [m]
    """

    share_near: float
    excursions_per_hour: float
    largest: float


def margins(offsets: Sequence[FloatArray], lane_widths: Sequence[FloatArray], step: float) -> Margins:
    """Time near a marking and rate of excursions over several runs (offset and lane width [m] at an even step [s]).

    Shape (n_i,) each.
    """
    near = [np.abs(x) > 0.5 * w - NEAR_MARKING for x, w in zip(offsets, lane_widths, strict=True)]
    rows = sum(len(one) for one in near)
    entries = sum(int((one[1:] & ~one[:-1]).sum()) for one in near)
    return Margins(
        share_near=sum(int(one.sum()) for one in near) / rows,
        excursions_per_hour=entries / (rows * step / 3600.0),
        largest=max(float(np.abs(x).max()) for x in offsets),
    )
