"""Maneuver profile: how drivers of a recording change lanes, as a smoothed joint sample, rates, and the way before.

References
----------
.. [1] B. W. Silverman, "Density Estimation for Statistics and Data Analysis", 1986, section 6.4: smoothed bootstrap,
   with the width of the kernel for normal data, and shrunk so that variances stay those of the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.base.numbers import all_significant, significant
from xosc_lateral.drivers.model.records import Record

COLUMNS = ("duration", "speed", "speed_change", "lane_width", "length", "gap", "closing_speed")
"""Of the sample: [s], at the begin [m/s], until the end [m/s], [m], of the vehicle [m]; to the vehicle ahead in its own
lane at the begin, between bumpers [m], and how fast that gets less [m/s], NaN: there is none within sight."""

SAMPLED, DIGITS = 200, 4
"""Rows that a profile holds, and significant digits of them: their noise is far above. [-]"""

LEAST_CHANGES = 20
"""Lane changes that a profile takes: the error of their median duration is then 8 %. [-]"""

BEFORE_STEP = 0.2
"""Of the mean way before. [s]"""


class Maneuvers(Record, frozen=True):
    """Lane changes of drivers; raises `DriverProfileError` if columns are missing or not equally long."""

    changes: Annotated[int, Meta(ge=1, description="Lane changes that were measured.")]
    hours: Annotated[float, Meta(gt=0, description="Of lane keeping beside them. [h]")]
    aborted: Annotated[int, Meta(ge=0, description="Lane changes that were given up.")]
    left: Annotated[tuple[bool, ...], Meta(description="Of the sample: whether to the left.")]
    sample: Annotated[Mapping[str, tuple[float | None, ...]], Meta(description="Smoothed, rows belong together.")]
    # By side, every 0.2 s up to the begin: from where they drive at the first of these moments, positive left. [m]
    before: Annotated[Mapping[str, tuple[float, ...]], Meta(description="Mean way before, by side. [m]")]
    recording: str = ""

    def __post_init__(self) -> None:
        if set(self.sample) != set(COLUMNS) or {len(self.left)} != {len(rows) for rows in self.sample.values()}:
            raise DriverProfileError(f"maneuvers: sample of {', '.join(self.sample)}, expected {', '.join(COLUMNS)}")

    def column(self, name: str) -> FloatArray:
        """Of the sample, shape (n,); see `COLUMNS`."""
        return np.array([np.nan if value is None else value for value in self.sample[name]])

    def weights(self, *, left: bool, speed: float, lane_width: float, gap: float = np.nan) -> FloatArray:
        """Of the sample's rows for a lane change to a side, at a speed [m/s], in a lane [m]; shape (n,), sum 1. [-]

        The nearest weigh most, on the scale of the sample's own deviations; where it has none to that side, all do.
        `gap`: to the vehicle ahead [m], NaN: there is none; rows with and without one are a deviation apart.
        """
        sides = np.array(self.left) == left
        distance = np.zeros(len(sides))
        for name, value in (("speed", speed), ("lane_width", lane_width), ("gap", float(np.log(max(gap, 0.1))))):
            known = np.log(self.column(name)) if name == "gap" else self.column(name)  # nearness is a ratio
            there = np.isfinite(known)
            scale = max(float(known[there].std()), 1e-6) if there.any() else 1.0
            apart = np.where(there & np.isfinite(value), (known - value) / scale, there != np.isfinite(value))
            distance += apart**2
        allowed = sides if sides.any() else ~sides
        weights = np.where(allowed, np.exp(-0.5 * (distance - distance[allowed].min())), 0.0)
        return np.asarray(weights / weights.sum())

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
        low, middle, high = np.quantile(self.column("duration"), (0.1, 0.5, 0.9))
        total = self.changes + self.aborted
        return (
            f"{self.changes} lane changes, {self.changes / self.hours:.0f} an hour of lane keeping, {middle:.1f} s "
            f"(80 %: {low:.1f} to {high:.1f} s), {100.0 * np.mean(self.left):.0f} % to the left; "
            f"{100.0 * self.aborted / total:.0f} % given up"
        )


def fit_maneuvers(
    measured: Mapping[str, FloatArray],
    left: BoolArray,
    *,
    before: Mapping[str, FloatArray],
    hours: float,
    aborted: int,
    recording: str,
    seed: int = 0,
) -> Maneuvers:
    """From measured lane changes: `COLUMNS`, shape (n,) each, and to which side; raises `NotEnoughDataError`.

    `before`: side -> ways before, shape (k, m). [m]
    """
    n = len(left)
    if n < LEAST_CHANGES:
        raise NotEnoughDataError(
            f"{recording}: {n} lane changes from begin to end; a maneuver profile takes {LEAST_CHANGES}"
        )
    rng = np.random.default_rng(seed)
    drawn = rng.integers(n, size=SAMPLED)
    width = (4.0 / (n * (len(COLUMNS) + 2.0))) ** (1.0 / (len(COLUMNS) + 4.0))
    sample = dict[str, tuple[float | None, ...]]()
    for name in COLUMNS:
        raw = np.log(measured[name]) if name in ("duration", "gap") else measured[name]
        known = raw[np.isfinite(raw)]
        mean, spread = (float(known.mean()), float(known.std())) if len(known) else (0.0, 0.0)
        noise = width * spread * rng.standard_normal(SAMPLED)
        values = mean + (raw[drawn] - mean + noise) / np.sqrt(1.0 + width**2)
        values = np.exp(values) if name in ("duration", "gap") else values
        sample[name] = tuple(significant(value, DIGITS) if np.isfinite(value) else None for value in values.tolist())
    ways = {side: all_significant(rows.mean(axis=0), DIGITS) for side, rows in before.items() if len(rows)}
    sides = tuple(bool(left[k]) for k in drawn)
    return Maneuvers(n, significant(hours, DIGITS), aborted, sides, sample, ways, recording)
