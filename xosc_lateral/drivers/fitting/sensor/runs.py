"""The driver's part of measured runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.numbers import significant
from xosc_lateral.drivers.drives.drive import Drive, Run
from xosc_lateral.drivers.drives.resampling import STEP, resample
from xosc_lateral.drivers.fitting.sensor.periodogram import PASSED, WINDOWS
from xosc_lateral.drivers.fitting.sensor.separation import separate
from xosc_lateral.drivers.model.sensor import SensorModel

LEAST_BAND = 0.35
"""A driver's corrections fall off from 0.27 Hz on: noise shows beyond. [Hz]"""


def driver_runs(
    runs: Sequence[Run], drives: Sequence[Drive] = (), *, sensor_noise: float | None = None
) -> tuple[list[Run], SensorModel | None]:
    """Runs with the sensor's part taken out, and what it was; as they are, and None, where all are too short; as they
    are where they count below `LEAST_BAND` alone: no sensor shows there.

    With the drives that they were cut from, variances are those of the rows as recorded, of which the runs are a
    low-passed version. For `sensor_noise` see `separate`.
    """
    if max(map(len, runs), default=0) * STEP < WINDOWS[-1]:
        return list(runs), None
    highest = min(run.valid_below or PASSED for run in runs)
    if highest < LEAST_BAND:
        variance = float(np.concatenate([run.offset for run in runs]).var())
        return list(runs), SensorModel(0.0, driver_variance=significant(variance, 7), driver_share=(1.0, 1.0))
    rows, rate = rows_of(runs, drives)
    separated = separate(
        [run.offset for run in runs],
        STEP,
        rows=rows,
        durations=durations_of(runs, drives),
        rate=rate,
        sensor_noise=sensor_noise,
        half_widths=half_widths_of(runs, drives),
        one_camera=all(drive.mended is not None for drive in drives),
        highest=highest,
    )
    return [replace(run, offset=separated.driver_part(run.offset, STEP)) for run in runs], separated.sensor


def rows_of(runs: Sequence[Run], drives: Sequence[Drive]) -> tuple[list[FloatArray] | None, float | None]:
    """Offsets of the runs as recorded [m], and rows per second [Hz]; None where not all drives are there."""
    cut = _recorded(runs, drives)
    if cut is None:
        return None, None
    steps = np.concatenate([np.diff(drive.time[rows]) for drive, rows in cut])
    return [drive.offset[rows] for drive, rows in cut], 1.0 / float(np.median(steps))


def durations_of(runs: Sequence[Run], drives: Sequence[Drive]) -> list[FloatArray] | None:
    """How long each row of the runs stands for, up to the middles between it and its neighbours [s]; None as above."""
    cut = _recorded(runs, drives)
    return None if cut is None else [np.gradient(drive.time[rows]) for drive, rows in cut]


def half_widths_of(runs: Sequence[Run], drives: Sequence[Drive]) -> list[FloatArray] | None:
    """Half the lane width in each run [m]; None where not all drives are there, or a camera measured not all."""
    cut = _recorded(runs, [drive for drive in drives if drive.half_width is not None])
    if cut is None:
        return None
    return [
        resample(drive.time[rows], np.asarray(drive.half_width)[rows], run.time)
        for run, (drive, rows) in zip(runs, cut, strict=True)
    ]


def _recorded(runs: Sequence[Run], drives: Sequence[Drive]) -> list[tuple[Drive, slice]] | None:
    """The drive that each run was cut from, and its rows there; None where not all drives are there."""
    known = {drive.name: drive for drive in drives}
    if not all(run.drive in known for run in runs):
        return None
    ends = [np.searchsorted(known[run.drive].time, (run.time[0] - 1e-6, run.time[-1] + 1e-6)) for run in runs]
    return [(known[run.drive], slice(*map(int, two))) for run, two in zip(runs, ends, strict=True)]
