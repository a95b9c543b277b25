"""Fit a profile to measured drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace as with_fields

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, significant
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import Segment
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.drives.drive import PAPER_RULES, STEP, CutRules, Drive, Run, all_runs, resample
from xosc_lateral.drivers.evaluation import look_words
from xosc_lateral.drivers.evaluation.sizes import sizes_of_runs
from xosc_lateral.drivers.fitting import closing
from xosc_lateral.drivers.fitting.bands import SPLIT_AT, density_of, fast_part_of
from xosc_lateral.drivers.fitting.context_effects import (
    LEAST_DRIVES,
    beside_effects,
    fit_context_effects,
    measure_beside,
    without_effects,
)
from xosc_lateral.drivers.fitting.joined_bands import COMPARED_FREQUENCIES, KEEPING_BAND, in_bands, split_by_band
from xosc_lateral.drivers.fitting.sensor.periodogram import (
    COARSE_STEP_RATIO,
    PASSED_FREQUENCY,
    WINDOWS,
    uniform_variance,
)
from xosc_lateral.drivers.fitting.sensor.separation import separate
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.core.registry import FitCore, model_named
from xosc_lateral.drivers.model.plausibility import ACCELERATION_LIMIT, JERK_LIMIT, comfort, strain
from xosc_lateral.drivers.model.profile import DriverProfile, Provenance
from xosc_lateral.drivers.model.sampling import sample_offsets
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

    `provenance`: what is known about the drives; hours, counts and fit settings are filled in. `sensor_noise`: standard
    deviation of the sensor's error on the rows, rounding included, where it is known [m]. `neighbours`: whether a
    population's profile holds how its drivers keep away from vehicles beside them, None: where they are known. `prior`:
    where its movement comes from above the band that the drives show (`Drive.valid_below`), if no other drives show it;
    `stand_in` gives it, for a model of ours, where the drives state a band that ends below `KEEPING_BAND`.
    """
    slow, fast = split_by_band(drives)
    runs, fast_runs = all_runs(slow, rules), list[Run]()
    is_paper = model_named(model).model.kind == ModelKind.TWO_LEVEL  # which takes offsets as they were measured
    if is_paper and neighbours:
        raise DriverProfileError(f"a {ModelKind.TWO_LEVEL} profile is fitted without what neighbours do")
    if is_paper and (fast or prior is not None):
        raise DriverProfileError(f"a {ModelKind.TWO_LEVEL} profile is fitted to one recording alone")
    if not is_paper:
        if stand_in is not None and not fast and any((drive.valid_below or np.inf) < KEEPING_BAND for drive in slow):
            prior = stand_in()
        runs, sensor = driver_runs(runs, slow, sensor_noise=sensor_noise)
        known = provenance or Provenance()
        known = replace(known, fit={**known.fit, **_marking_notes(slow)})
        profile = fit_population(runs, name=name, model=model, provenance=known, sensor=sensor, neighbours=neighbours)
        if fast:
            fast_runs, _ = driver_runs(all_runs(fast, rules), fast)
        return closing.looked_at(in_bands(profile, runs, fast_runs, prior), runs)
    return in_bands(fit_runs(runs, name=name, model=model, provenance=provenance), runs)


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
    fit_core: FitCore | None = None,
) -> DriverProfile:
    """Fit a profile to the driver's part of runs: what class, lane, speed and neighbours do first, then the drivers.

    Runs come without the sensor's part (`driver_runs`), which the profile keeps. For `neighbours` see `fit_profile`,
    for `fit_core` see `fit_runs`.
    """
    few, beside = len({run.drive for run in runs}) < LEAST_DRIVES and neighbours is not False, measure_beside(runs)
    effects = beside_effects(runs, beside) if few and beside else fit_context_effects(runs, neighbours=neighbours)
    profile = fit_runs(without_effects(runs, effects), name=name, model=model, provenance=provenance, fit_core=fit_core)
    return replace(profile, sensor=sensor, effects=effects, beside=beside)


def fit_runs(
    runs: Sequence[Run],
    *,
    name: str,
    model: ModelKind | str = ModelKind.AUTOREGRESSIVE,
    provenance: Provenance | None = None,
    fit_core: FitCore | None = None,
) -> DriverProfile:
    """Fit a profile to runs that are cut already, by the model's own fit or `fit_core`; its provenance says on what."""
    core = (fit_core or model_named(model).fit)([run.rel_offset for run in runs], [run.drive for run in runs])
    known, step, widths = provenance or Provenance(), core.step, np.concatenate([run.lane_width for run in runs])
    known = replace(
        known,
        hours=round(sum(map(len, runs)) * step / 3600.0, 4),
        drives=len({run.drive for run in runs}),
        runs=len(runs),
        fit={**known.fit, "model": core.kind, "step_s": step, "sizes": sizes_of_runs(runs, step).to_dict()},
        package_version=__version__,
    )
    return DriverProfile(name=name, model=core, lane_width=float(np.median(widths)), provenance=known)


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
    half_widths = half_widths_of(runs, drives)
    separated = separate(
        [run.offset for run in runs],
        STEP,
        rows=rows,
        durations=durations,
        rate=rate,
        sensor_noise=sensor_noise,
        half_widths=half_widths,
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


# ---- what to know about a fitted profile before it is used: its sensor, how it can be driven, its band ----
TRAFFIC_ACCELERATION = 0.6
"""Twice what 99.9 % of real motorway traffic stays below: beyond, a profile whose sensor was not told apart from its
driver probably holds the sensor's noise. [m/s2]"""

ERROR_RATIO = 1.15
"""A sensor's error found may be so many times the one given: by chance errors go along with the path. [-]"""

FREE_RUN, FREE_SPEED = 1200.0, 30.0
"""Sampled to see what a profile writes. [s], [m/s]"""

MINIMUM_POWER_SHARE = 0.2
"""Share of other drivers' power below which movement falls as no driver's does: real ones differ by a factor of two to
either side. [-]"""


def fit_warnings(
    profile: DriverProfile, sensor_noise: float | None = None, reference: DriverProfile | None = None
) -> list[str]:
    """What to know about a profile, in lines, and about the error of its sensor as far as it was given. [m]

    With a `reference`, of real drivers, also about its band.
    """
    return [
        *profile.provenance.fit.get("evidence", ()), *_beside_given(profile, sensor_noise), *_coarse_steps(profile),
        *_strained(profile), *([look_words.in_words(profile)] if look_words.found_in(profile)[1] else []),
        *([] if reference is None else _band_warnings(profile, reference)),
    ]  # fmt: skip


def _beside_given(profile: DriverProfile, stated: float | None) -> list[str]:
    """Where the drives don't bear out a sensor error that was given."""
    sensor = profile.sensor
    if stated is None:
        return []
    if sensor is None:
        return [f"runs are too short to separate driver and sensor: the error of {stated:g} m is not used"]
    least = float(np.sqrt(uniform_variance(sensor.rounding)))
    if stated < least / ERROR_RATIO:
        return [
            f"a sensor error of {stated:g} m is less than that of rounding to {sensor.rounding:.3g} m alone, "
            f"{least:.2g} m: taken for rounding and nothing else"
        ]
    noise = float(np.sqrt(sensor.sensor_variance))
    is_rounding = least > noise / ERROR_RATIO  # that of coarse steps is not even
    if is_rounding or noise / ERROR_RATIO < stated < ERROR_RATIO * noise:
        return []
    return [f"the drives contradict a sensor error of {stated:g} m: {noise:.2g} m is what explains them best beside it"]


def _coarse_steps(profile: DriverProfile) -> list[str]:
    sensor = profile.sensor
    if sensor is None or sensor.is_told_apart:
        return []
    deviation = np.sqrt(sensor.driver_variance + sensor.sensor_variance)
    if sensor.rounding <= COARSE_STEP_RATIO * deviation:  # little data, not steps
        return []
    return [
        f"the offsets are rounded to {sensor.rounding:.3g} m, too coarse to show how far the driver of {profile.name} "
        "moves between steps"
    ]


def _strained(profile: DriverProfile) -> list[str]:
    segment = Segment.even(FREE_RUN, profile.model.step, profile.lane_width, FREE_SPEED)
    speed = segment.speed
    strained = strain(sample_offsets(profile, segment, 1), profile.model.step, speed)
    if strained.excess > 1.0:
        return [
            f"movement of {profile.name} could not be driven at {speed[0]:g} m/s: lateral acceleration above "
            f"{strained.seldom:.2f} m/s2 for 0.1 % of the time (comfort limit {float(comfort(speed[:1])[0]):.2f}), "
            f"at most {strained.largest:.1f} m/s2, jerk at most {strained.jerk:.1f} m/s3 "
            f"(UN R79: {ACCELERATION_LIMIT:g} and {JERK_LIMIT:g}); convert will smooth it"
        ]
    if strained.seldom > TRAFFIC_ACCELERATION and not (profile.sensor and profile.sensor.is_told_apart):
        return [
            f"lateral acceleration of {profile.name} is above {strained.seldom:.2f} m/s2 for 0.1 % of the time, twice "
            "that of real motorway traffic or more: check the sensor that measured the drives"
        ]
    return []


def smoothed_above(profile: DriverProfile, reference: DriverProfile) -> float | None:
    """Frequency above which a profile has less than `MINIMUM_POWER_SHARE` of real drivers' power at its speed. [Hz]

    None where it is not, up to `KEEPING_BAND`. `reference`: profile of those.
    """
    speed = profile.validity.speed
    if speed is None or profile.model.kind != ModelKind.AUTOREGRESSIVE:
        return None
    top = min(KEEPING_BAND, profile.validity.highest_frequency or KEEPING_BAND)
    at = COMPARED_FREQUENCIES[(COMPARED_FREQUENCIES >= SPLIT_AT) & (top >= COMPARED_FREQUENCIES)]
    fast = fast_part_of(reference)
    driven = np.array([0.5 * sum(speed)])
    strength = sum(
        float(grown[0]) for effect in fast.effects if (grown := effect.strength(STEP, {"speed": driven})) is not None
    )
    low = density_of(profile)(at) < MINIMUM_POWER_SHARE * np.exp(2.0 * strength) * fast.density(at)
    if not len(at) or not low[-1]:
        return None
    return float(np.round(at[len(at) - int(np.argmin(low[::-1])) if not low.all() else 0], 2))


def _band_warnings(profile: DriverProfile, reference: DriverProfile) -> list[str]:
    """What to know about the band that a profile's drives show."""
    highest = profile.validity.highest_frequency
    if profile.model.kind != ModelKind.AUTOREGRESSIVE:
        return []
    if highest is not None and highest < KEEPING_BAND:
        what = f"{profile.name} moves below {highest:g} Hz alone, as its drives show it"
        return [f"{what}: a second table or --prior gives it what is faster"]
    above = smoothed_above(profile, reference)
    if above is None:
        return []
    return [
        f"above {above:g} Hz {profile.name} has less than a fifth of the power of real drivers: if the drives were "
        "smoothed, say so with --valid-below"
    ]
