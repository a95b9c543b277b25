"""Fit a profile to measured drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace as with_fields

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.numbers import significant
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.drives.cuts import PAPER_RULES, CutRules, all_runs
from xosc_lateral.drivers.drives.drive import Drive, Run
from xosc_lateral.drivers.drives.resampling import STEP, resample
from xosc_lateral.drivers.evaluation.sizes import sizes_of_runs
from xosc_lateral.drivers.fitting.bands import KEEPING_BAND, in_bands, split_by_band
from xosc_lateral.drivers.fitting.context_effects import (
    LEAST_DRIVES,
    beside_effects,
    fit_context_effects,
    measure_beside,
    without_effects,
)
from xosc_lateral.drivers.fitting.sensor.periodogram import PASSED_FREQUENCY, WINDOWS
from xosc_lateral.drivers.fitting.sensor.separation import separate
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.core.registry import model_named
from xosc_lateral.drivers.model.profile import DriverProfile, Provenance
from xosc_lateral.drivers.model.sensor import SensorModel


def fit_profile(
    drives: Sequence[Drive],
    *,
    name: str,
    model: ModelKind | str = ModelKind.AUTOREGRESSIVE,
    rules: CutRules = PAPER_RULES,
    provenance: Provenance | None = None,
    sensor_noise: float | None = None,
    neighbours: bool | None = None,
    prior: DriverProfile | None = None,
    stand_in: Callable[[], DriverProfile] | None = None,
) -> DriverProfile:
    """Cut drives into runs, separate driver and sensor, and fit a profile.

    Of a population it holds what class, lane and speed do to level, spread and fine movement, and neighbours to the
    level, as far as they are known (`context_effects`); of few drives, and of the two-level model, nothing of that.

    Raises `NotEnoughDataError` when too little is left after cutting, or neighbours are asked for (True) and not known;
    `DriverProfileError` when neighbours are asked for (True) of the two-level model, which is the paper's to the
    letter, or drives of different bands are given to it.

    Parameters
    ----------
    provenance : Provenance, optional
        What is known about the drives; hours, counts and fit settings are filled in.
    sensor_noise : float, optional
        Standard deviation of the sensor's error on the rows, rounding included, where it is known. [m]
    neighbours : bool, optional
        Whether a population's profile holds how its drivers keep away from vehicles beside them. None: where they are
        known.
    prior : DriverProfile, optional
        Where its movement comes from above the band that the drives show (`Drive.valid_below`), if no other drives show
        it: without, there is none above.
    stand_in : callable, optional
        Gives the prior, of a model of ours, where the drives state a band that ends below `KEEPING_BAND`.
    """
    slow, fast = split_by_band(drives)
    runs = all_runs(slow, rules)
    if model_named(model).model.kind == ModelKind.TWO_LEVEL:  # the paper takes offsets as they were measured
        if neighbours:
            raise DriverProfileError(f"a {ModelKind.TWO_LEVEL} profile is fitted without what neighbours do")
        if fast or prior is not None:
            raise DriverProfileError(f"a {ModelKind.TWO_LEVEL} profile is fitted to one recording alone")
        return in_bands(fit_runs(runs, name=name, model=model, provenance=provenance), runs)
    is_partial = not fast and any((drive.valid_below or np.inf) < KEEPING_BAND for drive in slow)
    if stand_in is not None and is_partial:
        prior = stand_in()
    cleaned, sensor = driver_runs(runs, slow, sensor_noise=sensor_noise)
    known = provenance or Provenance()
    known = replace(known, fit={**known.fit, **_marking_notes(slow)})
    profile = fit_population(cleaned, name=name, model=model, provenance=known, sensor=sensor, neighbours=neighbours)
    fast_runs = driver_runs(all_runs(fast, rules), fast)[0] if fast else ()
    return in_bands(profile, cleaned, fast_runs, prior)


def _marking_notes(drives: Sequence[Drive]) -> Mapping[str, float]:
    """Shares of all rows that follow one marking, and that were left out, where a camera had misjudged any."""
    mended = [(len(drive), drive.mended) for drive in drives if drive.mended]
    rows = sum(map(len, drives))
    if not mended:
        return {}
    followed = sum(count * shares.one_marking for count, shares in mended) / rows
    left_out = sum(count * shares.no_marking for count, shares in mended) / rows
    return {"one_marking": round(followed, 4), "no_marking": round(left_out, 4)}


def fit_population(
    runs: Sequence[Run],
    *,
    name: str,
    model: ModelKind | str = ModelKind.AUTOREGRESSIVE,
    provenance: Provenance | None = None,
    sensor: SensorModel | None = None,
    neighbours: bool | None = None,
) -> DriverProfile:
    """Fit a profile to the driver's part of runs: what class, lane, speed and neighbours do first, then the drivers.

    Runs come without the sensor's part (`driver_runs`), which the profile keeps. For `neighbours` see `fit_profile`.
    """
    few, beside = len({run.drive for run in runs}) < LEAST_DRIVES, measure_beside(runs)
    if few and neighbours is not False and beside:
        effects = beside_effects(runs, beside)
    else:
        effects = fit_context_effects(runs, neighbours=neighbours)
    profile = fit_runs(without_effects(runs, effects), name=name, model=model, provenance=provenance)
    return replace(profile, sensor=sensor, effects=effects, beside=beside)


def fit_runs(
    runs: Sequence[Run],
    *,
    name: str,
    model: ModelKind | str = ModelKind.AUTOREGRESSIVE,
    provenance: Provenance | None = None,
) -> DriverProfile:
    """Fit a profile to runs that are cut already; its provenance says on what and how."""
    core = model_named(model).fit([run.rel_offset for run in runs], [run.drive for run in runs])
    known, step = provenance or Provenance(), core.step
    known = replace(
        known,
        hours=round(sum(map(len, runs)) * step / 3600.0, 4),
        drives=len({run.drive for run in runs}),
        runs=len(runs),
        fit={**known.fit, "model": core.kind, "step_s": step, "sizes": sizes_of_runs(runs, step).to_dict()},
        package_version=__version__,
    )
    width = float(np.median(np.concatenate([run.lane_width for run in runs])))
    return DriverProfile(name=name, model=core, lane_width=width, provenance=known)


# ---- The driver's part of measured runs ----
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
    highest = min(run.valid_below or PASSED_FREQUENCY for run in runs)
    if highest < LEAST_BAND:
        variance = float(np.concatenate([run.offset for run in runs]).var())
        return list(runs), SensorModel(0.0, driver_variance=significant(variance, 7), driver_share=(1.0, 1.0))
    rows, durations, rate = rows_of(runs, drives)
    separated = separate(
        [run.offset for run in runs],
        STEP,
        rows=rows,
        durations=durations,
        rate=rate,
        sensor_noise=sensor_noise,
        half_widths=half_widths_of(runs, drives),
        one_camera=all(drive.mended is not None for drive in drives),
        highest=highest,
    )
    return [with_fields(run, offset=separated.driver_part(run.offset, STEP)) for run in runs], separated.sensor


def rows_of(
    runs: Sequence[Run], drives: Sequence[Drive]
) -> tuple[list[FloatArray] | None, list[FloatArray] | None, float | None]:
    """Offsets of the runs as recorded [m], how long each row stands for, up to the middles between it and its
    neighbours [s], and rows per second [Hz]; None where not all drives are there."""
    cut = _recorded(runs, drives)
    if cut is None:
        return None, None, None
    times = [drive.time[rows] for drive, rows in cut]
    rate = 1.0 / float(np.median(np.concatenate([np.diff(time) for time in times])))
    return [drive.offset[rows] for drive, rows in cut], [np.gradient(time) for time in times], rate


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
