"""How loud a sensor is in each zone of a recording, and how its level varies where the zone is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.digits import all_significant
from xosc_lateral.driver.records import Record
from xosc_lateral.driver.zone_levels import Passages, zone_levels
from xosc_lateral.drives.zones import Names, at_zones, numbered
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


DIGITS = 4
"""Significant digits kept of levels, and of what else is counted from jumps and windows. [-]"""


def tidy(values: Sequence[float] | FloatArray) -> tuple[float, ...]:
    """As a profile keeps them."""
    return all_significant(values, DIGITS)


class ByZone(Record, frozen=True):
    """Level of a sensor's error in each zone.

    Raises `DriverProfileError` if there is no zone, not as many levels as zones, or a number is out of its range.

    Parameters
    ----------
    zones : tuple of str
        Names in drive tables.
    levels : tuple of float
        Logarithm of the error's power in each, above that of all. [-]
    level_variance, level_duration, track_variance : float
        Of what varies besides, as of all (`SensorModel`, `SlopeJumps`). [-], [s], [-]
    """

    zones: tuple[str, ...]
    levels: tuple[float, ...]
    level_variance: float
    level_duration: float
    track_variance: float = 0.0

    def __post_init__(self) -> None:
        """Check."""
        spreads = (self.level_variance, self.track_variance)
        if not self.zones or len(self.zones) != len(self.levels) or not all(map(isfinite, (*self.levels, *spreads))):
            raise DriverProfileError(f"sensor by zone: {self}")
        if min(spreads) < 0.0 or not 0.0 < self.level_duration < inf:
            raise DriverProfileError(f"sensor by zone: {self}")

    def in_words(self) -> str:
        """How much the zones differ, in a sentence."""
        low, high = np.exp(0.5 * np.quantile(self.levels, [0.05, 0.95]))
        return f"in {len(self.zones)} zones the error is {low:.2g} to {high:.2g} times as large as on the whole (90 %)"

    def at(self, codes: FloatArray) -> FloatArray:
        """Logarithm of the power at rows in zones of these codes, shape (n,); 0 in a zone that is not known. [-]"""
        found = at_zones(codes, self.zones, self.levels)
        return np.where(np.isnan(found), 0.0, found)


@dataclass(frozen=True, eq=False)
class ZonedRows:
    """Where rows of runs were recorded, and by whom driven.

    Parameters
    ----------
    rows, runs : sequence of array of str, shape (n_i,)
        Zones of the rows as recorded, and of the runs at 5 Hz.
    drives : sequence of str
        Whose each run is.
    """

    rows: Sequence[Names]
    runs: Sequence[Names]
    drives: Sequence[str]


def levels_by_zone(levels: Sequence[FloatArray], zones: Sequence[Names], drives: Sequence[str]) -> ByZone | None:
    """Level of each zone above that of all, whose power is 1 in the mean; None if there is no more than chance.

    Of what varies besides, nothing is said yet.

    Parameters
    ----------
    levels : sequence of array, shape (k_i,)
        Logarithms of power, one array per run. [-]
    zones : sequence of array of str, shape (k_i,)
        Where each was recorded; empty: not known.
    drives : sequence of str
        Whose each run is.
    """
    parts = [
        (float(one[there == name].mean()), str(name), drive)
        for one, there, drive in zip(levels, zones, drives, strict=True)
        for name in numbered(there)[0]
        if name
    ]
    if not parts:
        return None
    level, zone, drive = zip(*parts, strict=True)
    found = zone_levels(Passages(np.array(level), zone, drive, np.empty((len(parts), 0))))
    if found is None:
        return None
    count = np.bincount(np.searchsorted(found.names, zone), minlength=len(found.names))
    shift = float(np.log(np.average(np.exp(found.values), weights=count)))
    return ByZone(found.names, tuple((found.values - shift).tolist()), level_variance=0.0, level_duration=1.0)
