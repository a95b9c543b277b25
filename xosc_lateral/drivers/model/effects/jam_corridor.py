"""The way that drivers leave between lanes for rescue vehicles, in a jam on a motorway.

Laws ask for it (in Germany section 11 (2) of the StVO: the leftmost lane keeps left, all others right, as soon as
traffic crawls or stands) and the paper's outlook names it; how far drivers go, no recording that we have shows: the
sizes are assumed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.drivers.model.effects.base import Acts, ColumnEffect

HALF_CAR = 0.9
"""Of a car's width. [m]"""


class JamCorridor(ColumnEffect, frozen=True, kw_only=True):
    """Left in the leftmost lane, right in all others, where `motorway` is 1 and there are two lanes or more.

    Faded in from 40 km/h down to `crawling`, and never so far that a car would come closer to the marking than `kept`.
    """

    words: ClassVar[str] = "assumed: as the law says, up to {0.size:.2g} m"

    acts: Acts = Acts.LOCATION
    coefficients: tuple[float, ...] = (1.0,)
    errors: tuple[float, ...] = (0.0,)
    reference: tuple[float, ...] = (0.0,)
    response_s: float = 2.0
    response_order: int = 2
    size: Annotated[float, Meta(ge=0, description="Assumed. [m]")] = 0.4
    crawling: Annotated[float, Meta(ge=0, description="Below this speed it is there as a whole; assumed. [m/s]")] = 5.0
    kept: Annotated[float, Meta(ge=0, description="From the car's side to the marking; assumed. [m]")] = 0.3

    @property
    def columns(self) -> tuple[str, ...]:
        """Those that say where the vehicle is, and how slow."""
        return ("speed", "lane_index", "lane_count", "lane_width", "motorway")

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """How far to keep left, shape (n, 1). [m]"""
        speed, lane, count, width, motorway = (context[name] for name in self.columns)
        u = np.clip((MINIMUM_SPEED - np.abs(speed)) / max(MINIMUM_SPEED - self.crawling, 1e-3), 0.0, 1.0)
        room = np.clip(0.5 * width - HALF_CAR - self.kept, 0.0, self.size)
        there = (motorway > 0.0) & (count > 1.5) & (lane >= 0.0)
        side = np.where(lane > count - 1.5, 1.0, -1.0)
        return np.where(there, side * room * u**2 * (3.0 - 2.0 * u), 0.0)[:, None]
