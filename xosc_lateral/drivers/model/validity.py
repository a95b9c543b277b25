"""Where a profile is known to hold: frequencies, speeds, lane widths, roads, and the recordings that show it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.records import Record

SPEED_MARGIN = 2.8
"""Beyond the speeds measured before it is worth a warning: 10 km/h, as speed limits step. [m/s]"""

WIDTH_MARGIN = 0.25
"""Beyond the lane widths measured: lanes of one road class differ by as much. [m]"""

Interval = tuple[float, float]


def _kmh(speed: Interval) -> str:
    return f"{3.6 * speed[0]:.0f} to {3.6 * speed[1]:.0f} km/h"


class Band(Record, frozen=True):
    """Frequencies of the movement, and what it is known from there. Raises `DriverProfileError` if it is empty."""

    low: Annotated[float, Meta(ge=0, description="[Hz]")]
    high: Annotated[float, Meta(gt=0, description="[Hz]")]
    source: str = ""
    # Of that recording, where it is another than the profile's; beyond, movement grows by its law. [m/s]
    speed: Interval | None = None

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise DriverProfileError(f"validity: a band from {self.low:g} to {self.high:g} Hz")

    def in_words(self) -> str:
        """As "0.15 to 1 Hz (its source, 44 to 89 km/h)"."""
        facts = [self.source, "" if self.speed is None else _kmh(self.speed)]
        known = ", ".join(fact for fact in facts if fact)
        return f"{self.low:g} to {self.high:g} Hz{f' ({known})' if known else ''}"


class Validity(Record, frozen=True):
    """Where a profile is known to hold; what is not stated is not known."""

    bands: Annotated[tuple[Band, ...], Meta(description="Lowest first; between two, one passes into the other.")] = ()
    speed: Annotated[Interval | None, Meta(description="Least and greatest measured. [m/s]")] = None
    lane_width: Annotated[Interval | None, Meta(description="Least and greatest measured. [m]")] = None
    roads: Annotated[tuple[str, ...], Meta(description='In words: "motorway".')] = ()
    resolution: Annotated[float, Meta(ge=0, description="Of the offsets fitted; 0: not known. [m]")] = 0.0

    def __post_init__(self) -> None:
        for name in ("speed", "lane_width"):
            interval = getattr(self, name)
            if interval is not None and not 0.0 <= interval[0] <= interval[1]:
                raise DriverProfileError(f"validity: {name} from {interval[0]:g} to {interval[1]:g}")

    @property
    def highest_frequency(self) -> float | None:
        """Frequency up to which the movement is measured. [Hz]"""
        return max((band.high for band in self.bands), default=None)

    def in_words(self) -> str:
        """One line; empty where nothing is stated."""
        parts = [band.in_words() for band in self.bands]
        if parts:
            parts[-1] += ", above: assumed"
        if self.speed is not None:
            parts.append(_kmh(self.speed))
        if self.lane_width is not None:
            low, high = self.lane_width
            parts.append(f"lanes of {low:.2f} to {high:.2f} m" if high > low else f"lanes of {low:.2f} m")
        return "; ".join([*parts, *self.roads])

    def departures(self, speed: FloatArray, lane_width: FloatArray) -> list[str]:
        """In which respects speeds [m/s] and lane widths [m], of any shape, lie outside of what was measured."""
        lines = []
        for values, measured, margin, factor, unit in (
            (speed, self.speed, SPEED_MARGIN, 3.6, "km/h"),
            (lane_width, self.lane_width, WIDTH_MARGIN, 1.0, "m wide"),
        ):
            known = values[np.isfinite(values)]
            if measured is None or not len(known):
                continue
            low, high = float(known.min()), float(known.max())
            if low < measured[0] - margin or high > measured[1] + margin:
                digits = 0 if factor != 1.0 else 2
                within = f"{factor * measured[0]:.{digits}f} to {factor * measured[1]:.{digits}f}"
                lines.append(f"{factor * low:.{digits}f} to {factor * high:.{digits}f} {unit} (measured: {within})")
        return lines
