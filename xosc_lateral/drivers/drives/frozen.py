"""A camera that goes on saying the same: rows that were measured once and repeated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.drivers.drives.drive import Drive

FROZEN_TIME = 1.0
"""Shorter repetitions do no harm: they are bridged or averaged. [s]"""

CHANCE = 1e-6
"""A stretch is frozen where a drive whose values otherwise repeat as often would have one so long this rarely. [-]"""

CHANGES = 20
"""Fewer changes of value in a whole drive don't tell how often a value repeats: it was made, not measured. [-]"""


def frozen_rows(time: FloatArray, offset: FloatArray, lane_width: FloatArray) -> BoolArray:
    """Rows, but the first, of stretches in which offset and lane width repeat to the last digit; shape (n,)."""
    found = np.zeros(len(time), dtype=np.bool_)
    same = (np.diff(offset) == 0.0) & (np.diff(lane_width) == 0.0)
    if (~same).sum() < CHANGES or (np.diff(offset) != 0.0).sum() < CHANGES:
        return found
    repeated = int(same.sum())
    for part in true_slices(same):
        count = part.stop - part.start
        usual = (repeated - count) / max(len(same) - count, 1)
        if time[part.stop] - time[part.start] >= FROZEN_TIME and len(same) * usual**count < CHANCE:
            found[part.start + 1 : part.stop + 1] = True
    return found


def summary_of(drives: Sequence[Drive]) -> Mapping[str, float]:
    """What shows exchanged sides and wrong units: mean and spread of the offset, lane width [m]; 5 and 95 % quantile of
    the speed [m/s]; time driven [h]; drivers, and the share of rows that a frozen camera repeated, where there are any.
    """
    offset = np.concatenate([drive.offset for drive in drives])
    speed = np.concatenate([drive.speed for drive in drives if drive.speed is not None] or [np.zeros(0)])
    speed = speed[np.isfinite(speed)]
    found = {
        "offset_mean_m": float(offset.mean()),
        "offset_sd_m": float(offset.std()),
        "lane_width_m": float(np.median(np.concatenate([drive.lane_width for drive in drives]))),
        "driven_h": sum(float(drive.time[-1] - drive.time[0]) for drive in drives) / 3600.0,
    }
    if len(speed):
        found |= {f"speed_{share}": float(np.quantile(speed, share / 100.0)) for share in (5, 95)}
    if drivers := {drive.driver for drive in drives if drive.driver}:
        found["drivers"] = len(drivers)
    if frozen := sum(drive.frozen for drive in drives):
        found["frozen"] = frozen / (frozen + len(offset))
    return {name: round(value, 4) for name, value in found.items()}
