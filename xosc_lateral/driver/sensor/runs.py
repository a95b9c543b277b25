"""The driver's part of measured runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.driver.sensor.periodogram import WINDOWS
from xosc_lateral.driver.sensor.separation import separate
from xosc_lateral.drives.drive import Drive, Run
from xosc_lateral.drives.resampling import STEP, resample

FloatArray = NDArray[np.float64]


def driver_runs(
    runs: Sequence[Run], drives: Sequence[Drive] = (), *, sensor_noise: float | None = None
) -> tuple[list[Run], SensorModel | None]:
    """Runs with the sensor's part taken out, and what it was.

    Parameters
    ----------
    runs : sequence of Run
    drives : sequence of Drive, optional
        That they were cut from: variances are then those of the rows as recorded, of which the runs are a low-passed
        version.
    sensor_noise : float, optional
        See `separate`.

    Returns
    -------
    list of Run, SensorModel or None
        The runs as they are, and None, where the longest is too short for a spectrum.
    """
    if max(map(len, runs), default=0) * STEP < WINDOWS[-1]:
        return list(runs), None
    rows, rate = rows_of(runs, drives)
    found = separate(
        [run.offset for run in runs],
        STEP,
        rows=rows,
        durations=durations_of(runs, drives) if rows else None,
        rate=rate,
        sensor_noise=sensor_noise,
        half_widths=half_widths_of(runs, drives),
        one_camera=all(drive.mended is not None for drive in drives),
    )
    return [replace(run, offset=found.driver_part(run.offset, STEP)) for run in runs], found.sensor


def rows_of(runs: Sequence[Run], drives: Sequence[Drive]) -> tuple[list[FloatArray] | None, float | None]:
    """Offsets of the runs as recorded [m], and rows per second [Hz]; None where not all drives are there."""
    known = {drive.name: drive for drive in drives}
    if not all(run.drive in known for run in runs):
        return None, None
    cut = [(known[run.drive], _rows(known[run.drive], run)) for run in runs]
    steps = np.concatenate([np.diff(drive.time[rows]) for drive, rows in cut])
    return [drive.offset[rows] for drive, rows in cut], 1.0 / float(np.median(steps))


def durations_of(runs: Sequence[Run], drives: Sequence[Drive]) -> list[FloatArray]:
    """How long each row of the runs stands for, up to the middles between it and its neighbours. [s]"""
    known = {drive.name: drive for drive in drives}
    return [np.gradient(known[run.drive].time[_rows(known[run.drive], run)]) for run in runs]


def half_widths_of(runs: Sequence[Run], drives: Sequence[Drive]) -> list[FloatArray] | None:
    """Half the lane width in each run [m]; None where not all drives are there, or a camera measured not all."""
    seen = {drive.name: (drive, drive.half_width) for drive in drives if drive.half_width is not None}
    if not all(run.drive in seen for run in runs):
        return None
    found = []
    for run in runs:
        drive, half_width = seen[run.drive]
        rows = _rows(drive, run)
        found.append(resample(drive.time[rows], half_width[rows], run.time))
    return found


def _rows(drive: Drive, run: Run) -> slice:
    """Of a drive, that lie in one of its runs."""
    first, last = np.searchsorted(drive.time, (run.time[0] - 1e-6, run.time[-1] + 1e-6))
    return slice(int(first), int(last))
