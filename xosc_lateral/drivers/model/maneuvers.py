"""How drivers of a recording change lanes: a law of nine numbers with their intervals, and the way before.

A lane change lasts e^x s, x normal: behind somebody with a mean that grows with the logarithm of the gap, else with one
of its own. That, how often there is somebody, to which side, how many an hour and how many are given up are figures
of a population; of one recording, in which neither speed nor side nor driver said more about the duration.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.records import Record

BEFORE_STEP = 0.2
"""Of the mean way before. [s]"""


class Figure(NamedTuple):
    """A figure of a law and its 95 % interval, in its own unit."""

    value: float
    low: float
    high: float

    def in_words(self, unit: str, digits: int = 1, scale: float = 1.0) -> str:
        """With its interval."""
        value, low, high = (f"{scale * one:.{digits}f}" for one in self)
        return f"{value} {unit} ({low} to {high})"


class Spread(NamedTuple):
    """Mean and standard deviation over drivers, each with its interval."""

    mean: Figure
    deviation: Figure


class Maneuvers(Record, frozen=True):
    """Lane changes of drivers; raises `DriverProfileError` if a figure is out of its range."""

    changes: Annotated[int, Meta(ge=1, description="Lane changes that were measured.")]
    hours: Annotated[float, Meta(gt=0, description="Of lane keeping beside them. [h]")]
    # Median durations [s], their exponent of the gap [-], and standard deviations of their logarithm [-].
    duration_alone: Annotated[Figure, Meta(description="Median duration with nobody ahead. [s]")]
    spread_alone: Annotated[Figure, Meta(description="Standard deviation of its logarithm. [-]")]
    gap: Annotated[Figure, Meta(description="To a vehicle ahead at the begin: mean by logarithm, 5 %, 95 %. [m]")]
    duration_behind: Annotated[Figure, Meta(description="Median duration at the mean gap. [s]")]
    gap_exponent: Annotated[Figure, Meta(description="Power of the gap that it grows with. [-]")]
    spread_behind: Annotated[Figure, Meta(description="Standard deviation of its logarithm. [-]")]
    behind: Annotated[Figure, Meta(description="Share with a vehicle ahead within sight. [-]")]
    left: Annotated[Figure, Meta(description="Share to the left. [-]")]
    rate: Annotated[Figure, Meta(description="An hour of lane keeping. [1/h]")]
    given_up: Annotated[Figure, Meta(description="Share that is given up, of all that begin. [-]")]
    # By side. Where they end, from the middle of the new lane, and the change of speed meanwhile.
    end: Annotated[Mapping[str, Spread], Meta(description="Offset at the end, positive left. [m]")] = {}
    speed_change: Annotated[Mapping[str, Spread], Meta(description="Change of speed until the end. [m/s]")] = {}
    # By side, every 0.2 s up to the begin: from where they drive at the first of these moments, positive left. [m]
    before: Annotated[Mapping[str, tuple[float, ...]], Meta(description="Mean way before, by side. [m]")] = {}
    recording: str = ""

    def __post_init__(self) -> None:
        for name in ("duration_alone", "duration_behind", "spread_alone", "spread_behind", "gap"):
            if not getattr(self, name).value > 0.0:
                raise DriverProfileError(f"maneuvers: {name} {getattr(self, name).value:g}, expected above 0")

    def duration(self, normal: FloatArray | float, gap: float = np.nan) -> FloatArray:
        """Of a driver at so many standard deviations from the median, shape as `normal`. [s]

        `gap`: to the vehicle ahead when it begins [m], beyond those that were measured as at the nearest of these; NaN:
        there is none within sight.
        """
        if np.isfinite(gap):
            ratio = float(np.clip(gap, self.gap.low, self.gap.high)) / self.gap.value
            median = self.duration_behind.value * ratio**self.gap_exponent.value
            return np.asarray(median * np.exp(self.spread_behind.value * np.asarray(normal)))
        return np.asarray(self.duration_alone.value * np.exp(self.spread_alone.value * np.asarray(normal)))

    def anticipation(self, time: FloatArray, begin: float, end: float, *, left: bool, free: float) -> FloatArray:
        """How drivers move in the seconds before a lane change from `begin` to `end`: offset, positive left. [m]

        At times, shape (n,); from the end of the maneuver before on (`free`). What is left at the begin fades until the
        end. [s]
        """
        way = np.array(self.before.get("left" if left else "right", (0.0,)))
        moments = begin + BEFORE_STEP * np.arange(1 - len(way), 1)
        first = min(max(moments[0], free), begin)
        moved = np.interp(time, moments, way) - np.interp(first, moments, way)
        fading = 0.5 + 0.5 * np.cos(np.pi * np.clip((time - begin) / (end - begin), 0.0, 1.0))
        return np.asarray(np.where(time < first, 0.0, moved * fading))

    def in_words(self) -> str:
        """In a line."""
        gap = f"{self.gap.value:.0f} m behind a vehicle"
        return (
            f"{self.changes} lane changes, {self.rate.in_words('an hour of lane keeping', 0)}, "
            f"{self.duration_alone.in_words('s')} with nobody ahead, {self.duration_behind.in_words('s')} {gap}; "
            f"{self.left.in_words('% to the left', 0, 100.0)}; {self.given_up.in_words('% given up', 0, 100.0)}"
        )
