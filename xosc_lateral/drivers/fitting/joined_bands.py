"""Which drives say what of each band of movement, and the profile that comes of it; where that is known to hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, significant
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.drive import PASS_BAND_EDGES, STEP, Drive, Run
from xosc_lateral.drivers.fitting.bands import (
    ROLL_OFF,
    SPLIT_AT,
    FastPart,
    density_of,
    fast_part_of,
    fast_part_of_runs,
    shows_growth,
    with_fast_part,
)
from xosc_lateral.drivers.fitting.sensor.periodogram import uniform_variance
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.validity import Band, Validity

KEEPING_BAND = 0.5
"""A recording that is valid up to here shows how people keep their lane; one of less needs another beside it. [Hz]"""

TAIL_SHARE = 0.01
"""Share of the rows left out at each end of the speeds and lane widths that count as measured. [-]"""

COMPARED_FREQUENCIES = np.linspace(0.02, PASS_BAND_EDGES, 149)
"""Frequencies at which driver and sensor are compared. [Hz]"""


def split_by_band(drives: Sequence[Drive]) -> tuple[list[Drive], list[Drive]]:
    """Drives that the population is fitted to, and those that add fast movement to it: none where all show as much."""
    bands = sorted({drive.valid_below or np.inf for drive in drives})
    if len(bands) == 1 or bands[0] >= KEEPING_BAND:
        return list(drives), []
    if len(bands) > 2 or bands[1] < KEEPING_BAND:
        stated = ", ".join(f"{band:g}" for band in bands)
        raise DriverProfileError(
            f"tables that are valid below {stated} Hz: at most two bands can be combined, of which the upper reaches "
            f"{KEEPING_BAND:g} Hz"
        )
    slow = [drive for drive in drives if (drive.valid_below or np.inf) == bands[0]]
    return slow, [drive for drive in drives if (drive.valid_below or np.inf) != bands[0]]


def measured(runs: Sequence[Run], highest: float | None = None, source: str = "") -> Validity:
    """What runs show: speeds, lane widths, resolution, and up to which frequency where that is known. [Hz]"""
    speeds = [run.speed for run in runs if run.speed is not None]
    steps = [run.resolution for run in runs if run.resolution is not None]
    return Validity(
        bands=() if highest is None else (Band(0.0, highest, source),),
        speed=_range(speeds) if speeds else None,
        lane_width=_range([run.lane_width for run in runs]),
        resolution=max(steps, default=0.0),
    )


def _range(parts: Sequence[FloatArray]) -> tuple[float, float]:
    low, high = np.quantile(np.concatenate(parts), (TAIL_SHARE, 1.0 - TAIL_SHARE)).tolist()
    return significant(low, 5), significant(high, 5)


def in_bands(
    profile: DriverProfile,
    runs: Sequence[Run],
    fast_runs: Sequence[Run] = (),
    prior: DriverProfile | None = None,
) -> DriverProfile:
    """A profile as fitted to runs, with its movement above their band from elsewhere, and what it is valid for.

    From `fast_runs`, of a recording that shows fast movement, or where there are none from `prior`.
    """
    stated = next((run.valid_below for run in runs if run.valid_below is not None), None)
    names = _sources(runs)
    known = measured(runs, stated, names)
    if profile.model.kind != ModelKind.AUTOREGRESSIVE:
        return replace(profile, validity=known)
    if fast_runs:
        highest = fast_runs[0].valid_below or PASS_BAND_EDGES
        fast = fast_part_of_runs(fast_runs, highest, _sources(fast_runs))
        return with_fast_movement(profile, known, stated or SPLIT_AT, fast, names)
    highest = stated or visible_below(profile)
    if prior is not None and highest < PASS_BAND_EDGES:
        return with_fast_movement(profile, known, highest, fast_part_of(prior), names)
    if highest < KEEPING_BAND and stated is not None:
        return replace(with_fast_part(profile, None, highest), validity=known)
    known = measured(runs, highest, names)
    if highest >= KEEPING_BAND and shows_growth(runs):
        profile = with_fast_part(profile, fast_part_of_runs(runs, highest, names), SPLIT_AT)
    return replace(profile, validity=known)


def with_fast_movement(
    profile: DriverProfile, known: Validity, below: float, fast: FastPart, source: str
) -> DriverProfile:
    """A profile with its own movement below a frequency [Hz], for which `source` are words, and a fast part above."""
    border = significant(ROLL_OFF * below, 3)  # from which on it is the fast part alone
    of_fast = Band(border, max(fast.highest, 1.01 * border), fast.source, fast.speed)
    bands = (Band(0.0, significant(below, 3), source), of_fast)
    return replace(with_fast_part(profile, fast, below), validity=replace(known, bands=bands))


def _sources(runs: Sequence[Run]) -> str:
    count = len({run.drive for run in runs})
    return f"{count} drive{'' if count == 1 else 's'}"


def visible_below(profile: DriverProfile) -> float:
    """Frequency below which a profile's driver moves more than its sensor errs, at most `PASS_BAND_EDGES`. [Hz]"""
    sensor = profile.sensor
    if sensor is None:
        return PASS_BAND_EDGES
    rounding = 2.0 * STEP * uniform_variance(sensor.rounding)
    hidden = density_of(profile)(COMPARED_FREQUENCIES) < sensor.density(COMPARED_FREQUENCIES) + rounding
    return PASS_BAND_EDGES if not hidden.any() else float(np.round(COMPARED_FREQUENCIES[np.argmax(hidden)], 2))
