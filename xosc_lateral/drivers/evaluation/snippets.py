"""Measured snippets of one length as arrays, and the same snippets sampled from a profile.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: snippets of 10 s, each sampled one from its real one's start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import tapered_powers, without_line
from xosc_lateral.drivers.evaluation.lane_keeping import INDICATORS, lane_keeping_indicators
from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    Distances,
    column_distances,
    metric_distances,
    snippet_metrics,
)
from xosc_lateral.drivers.evaluation.spectra import STOP_FREQUENCY
from xosc_lateral.drivers.fitting.models.two_level import split_levels
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.core.two_level.model import PAPER_SETTINGS
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import Snippet, cut_snippets, recorded_offsets, segment_of, sensor_error
from xosc_lateral.drivers.model.sampling import OffsetSampler, sample_offsets
from xosc_lateral.drivers.model.seeds import child

BLOCK_SECONDS = (
    120.0  # Where there are too few drives to split between them, blocks of this length are split instead. [s]
)
FEW_DRIVES = 6


@dataclass(frozen=True, eq=False)
class Snippets:
    """Snippets of measured driving."""

    seconds: float  # Their length. [s]
    items: tuple[Snippet, ...]  # Where each comes from.
    offset: FloatArray  # shape (n, m). [m]
    lane_width: FloatArray  # shape (n, m). [m]
    # shape (n,): Drive, or block of a drive: what is split between halves, and resampled, as a whole.
    group: NDArray[np.str_]
    place: tuple[tuple[int, slice], ...]  # Number of the run, and rows in it.

    def __len__(self) -> int:
        return len(self.items)

    @property
    def segments(self) -> list[Segment]:
        """Each with the context around it."""
        return [segment_of(one.run, one.rows) for one in self.items]

    def cut_from(self, paths: Sequence[FloatArray]) -> FloatArray:
        """The same snippets out of other paths of the same runs, shape (n, m). [m]"""
        return np.array([paths[number][rows] for number, rows in self.place]).reshape(self.offset.shape)


def snippets_of(runs: Sequence[Run], seconds: float, step: float, *, by_block: bool | None = None) -> Snippets:
    """All whole snippets, one after the other in each run, both ends counted (51 values for 10 s at 5 Hz).

    `by_block`: whether groups are blocks of a drive; without, where there are fewer than `FEW_DRIVES` drives.
    """
    length = round(seconds / step) + 1
    items = tuple(cut_snippets(runs, seconds, step)) if any(len(run) >= length for run in runs) else ()
    if by_block is None:
        by_block = len({run.drive for run in runs}) < FEW_DRIVES
    block = max(BLOCK_SECONDS, 2.0 * seconds)
    groups = [f"{one.run.drive} {int(one.time[0] // block)}" if by_block else one.run.drive for one in items]
    numbers = {id(run): number for number, run in enumerate(runs)}
    return Snippets(
        seconds,
        items,
        np.array([one.offset for one in items]).reshape(-1, length),
        np.array([one.run.lane_width[one.rows] for one in items]).reshape(-1, length),
        np.array(groups, dtype=np.str_),
        tuple((numbers[id(one.run)], one.rows) for one in items),
    )


def sample_snippets(profile: DriverProfile, snippets: Snippets, seed: int, *, with_sensor: bool = False) -> FloatArray:
    """For each snippet one of a new driver, of the same length, start and context. Shape (n, m). [m]

    With the sensor, what starts there is the sum of both, as it does in what was recorded.
    """
    rows = sample_recorded(profile, snippets.segments, snippets.offset[:, 0], seed, with_sensor=with_sensor)
    return np.array(rows).reshape(snippets.offset.shape)


def sample_recorded(
    profile: DriverProfile, segments: Sequence[Segment], starts: FloatArray, seed: int, *, with_sensor: bool = True
) -> list[FloatArray]:
    """For each segment one path [m] of a new driver from `starts` [m], as the profile's sensor would record it."""
    root, sensor = np.random.SeedSequence(seed), profile.sensor if with_sensor else None
    return [
        recorded_offsets(profile, segment, child(root, k), sensor, start)
        for k, (segment, start) in enumerate(zip(segments, starts.tolist(), strict=True))
    ]


def sample_runs(profile: DriverProfile, runs: Sequence[Run], seed: int, *, same_start: bool = True) -> list[FloatArray]:
    """For each run one of the same length and context, shape (n_i,) each. [m]

    With the same start each is of a new driver. Free runs of one drive are of one driver, who drives on between them,
    unseen: drivers are then as constant as the profile has them.
    """
    root = np.random.SeedSequence(seed)
    if same_start:
        return [
            sample_offsets(profile, segment_of(run), child(root, k), start=float(run.offset[0]))
            for k, run in enumerate(runs)
        ]
    paths, step = [np.empty(0)] * len(runs), profile.model.step
    in_time = sorted(range(len(runs)), key=lambda k: float(runs[k].time[0]))
    of_drive = grouped((runs[k].drive, k) for k in in_time)
    for number, drive in enumerate(dict.fromkeys(run.drive for run in runs)):
        driver, end = OffsetSampler(profile, child(root, number)), 0.0
        for k in of_drive[drive]:
            driver.skip(float(runs[k].time[0]) - end)
            paths[k], end = driver.sample(segment_of(runs[k])), float(runs[k].time[-1]) + step
    return paths


def sensor_noise(profile: DriverProfile, paths: Sequence[FloatArray], seed: int) -> list[FloatArray]:
    """What the profile's sensor adds to paths, shape (n_i,) each; zeros where it knows none. [m]"""
    root, step = np.random.SeedSequence(seed), profile.model.step
    return [sensor_error(profile.sensor, path, step, child(root, k)) for k, path in enumerate(paths)]


LENGTHS = (10.0, 30.0, 60.0)  # The paper's; long enough to see drivers come back; a minute. [s]


@dataclass(frozen=True)
class SnippetCondition:
    """What snippets that are compared have in common."""

    seconds: float  # Their length. [s]
    # A sampled snippet starts where its real one starts, and stands beside other drivers' snippets that start there
    # too. Else neither knows the start: sampled ones are cut from free runs.
    same_start: bool
    slow: bool = False  # Movement below a frequency alone, see `filters`; else everything that was recorded.
    below: float = STOP_FREQUENCY  # That frequency. [Hz]

    @property
    def name(self) -> str:
        """In words."""
        start = "same start" if self.same_start else "free"
        return f"{self.seconds:g} s, {start}" + (f", below {self.below:g} Hz" if self.slow else "")


FINE_SHIFT = 5.0  # Real fine parts are shifted round by this, to part them from their coarse parts. [s]


@dataclass(frozen=True, eq=False)
class PartEvaluation:
    """One of the paper's four evaluations."""

    # 1 real coarse + shifted real fine, 2 sampled coarse + real fine, 3 real coarse + sampled fine, 4 both sampled.
    number: int
    coarse: str  # Where each part comes from.
    fine: str
    real: FloatArray  # shape (n, 10): Metrics of the snippets. [m]
    artificial: FloatArray  # shape (n, 10)
    distances: Distances  # Between the two, all snippets.


def evaluate_parts(
    profile: DriverProfile, snippets: Snippets, sampled: FloatArray, *, seed: int
) -> tuple[PartEvaluation, ...]:
    """Run the paper's four evaluations; (4) takes `sampled`, effects included. `sampled` of shape (n, m). [m]"""
    # The paper's split of the measured snippets is made on whole runs, so that only a run's ends are ends.
    split = {id(one.run): split_levels(one.run.rel_offset, PAPER_SETTINGS) for one in snippets.items}
    coarse_real, fine_real = (
        np.array([split[id(one.run)][part][one.rows] for one in snippets.items]) for part in range(2)
    )
    root, relative = np.random.SeedSequence(seed), snippets.offset / snippets.lane_width
    coarse, fine = np.empty_like(relative), np.empty_like(relative)
    for k, start in enumerate(relative[:, 0].tolist()):  # without effects
        stream = profile.model.stream(child(root, k), Start(rel_offset=start))
        coarse[k], fine[k] = stream.take(relative.shape[1])
    shifted = np.roll(fine_real, round(FINE_SHIFT / profile.model.step), axis=1)
    width = snippets.lane_width
    combinations = (
        ("measured", "measured, shifted", (coarse_real + shifted) * width),
        ("sampled", "measured", (coarse + fine_real) * width),
        ("measured", "sampled", (coarse_real + fine) * width),
        ("sampled", "sampled", sampled),
    )
    real = snippet_metrics(snippets.offset)
    evaluations = []
    for number, (coarse_from, fine_from, rows) in enumerate(combinations, start=1):
        artificial = snippet_metrics(rows)
        distances = metric_distances(real, artificial)
        evaluations.append(PartEvaluation(number, coarse_from, fine_from, real, artificial, distances))
    return tuple(evaluations)


# ---- what is compared in a set of windows, computed once and then for any choice of rows ----
# A sampled window that starts where its real one starts knows something that a random real window does not. So it
# stands beside real windows of *other* drivers whose start is the same, and windows that know no start beside any
# windows of other drivers (A. Ramdas, N. García Trillos, M. Cuturi, "On Wasserstein two-sample testing", Entropy 19,
# 2017).
LAGS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0)  # Of the autocorrelation; those that fit into half a window are used. [s]
BANDS = np.geomspace(0.03, 1.0, 13)  # Edges of the spectrum's bands, eight a decade. [Hz]


@dataclass(frozen=True, eq=False)
class Features:
    """Of n windows."""

    metrics: FloatArray  # shape (n, 10)
    indicators: FloatArray  # shape (n, 7)
    power: FloatArray  # shape (n, bands): Power density in bands. [m2/Hz]
    products: FloatArray  # shape (n, lags): Mean product of offsets that far apart. [m2]
    moments: FloatArray  # shape (n, 2): Mean offset and mean square. [m], [m2]

    def __len__(self) -> int:
        return len(self.metrics)

    def take(self, rows: IntArray) -> Features:
        """Of some of the windows. `rows` of shape (k,). [-]"""
        return Features(
            self.metrics[rows], self.indicators[rows], self.power[rows], self.products[rows], self.moments[rows]
        )


def features_of(
    offset: FloatArray, lane_width: FloatArray, step: float, *, highest: float = float(BANDS[-1])
) -> Features:
    """Everything that `differences` needs of windows, shape (n, m); bands of the spectrum up to `highest` [Hz]."""
    m = offset.shape[1]
    lags = [round(lag / step) for lag in LAGS if round(lag / step) <= m // 2]
    products = [(offset[:, lag:] * offset[:, : m - lag]).mean(axis=1) for lag in lags]
    return Features(
        snippet_metrics(offset),
        lane_keeping_indicators(offset, lane_width, step),
        band_power(offset, step, highest=highest),
        np.array(products).reshape(len(lags), len(offset)).T,
        np.column_stack([offset.mean(axis=1), (offset**2).mean(axis=1)]),
    )


def band_power(offset: FloatArray, step: float, *, highest: float = float(BANDS[-1])) -> FloatArray:
    """Power density of each window in the bands that it can resolve (straight line removed, Hann window). [m2/Hz]

    Shape (n, bands).
    """
    m = offset.shape[1]
    window = np.hanning(m)
    power = tapered_powers(without_line(offset), window, size=4 * m) * 2.0 * step / (window**2).sum()
    frequency = np.fft.rfftfreq(4 * m, step)
    bands = [(frequency >= low) & (frequency < high) for low, high in resolved_bands(m * step, highest)]
    return np.array([power[:, inside].mean(axis=1) for inside in bands]).reshape(len(bands), len(offset)).T


def resolved_bands(seconds: float, highest: float = float(BANDS[-1])) -> list[tuple[float, float]]:
    """Bands up to `highest` whose lower edge a window of that length goes through at least once. [Hz]"""
    bands = [(float(low), float(high)) for low, high in pairwise(BANDS)]
    return [(low, high) for low, high in bands if low * seconds >= 1.0 and high <= highest]


MINIMUM_POWER = 1e-9  # Added to power densities, so that no movement is a number too: 0.03 mm in 1 Hz. [m2/Hz]
UNITS = {"metrics": "sd", "lane_keeping": "sd", "spectrum": "dB", "memory": "-"}  # Of each kind of difference.


def differences(real: Features, other: Features, rows: IntArray, other_rows: IntArray) -> dict[str, float]:
    """How far apart two sets of windows are, by family; `rows`: windows that count, and how often.

    `metrics`, `lane_keeping`: mean Wasserstein distance in standard deviations of the real ones [sd]; `spectrum`: rms
    difference over the bands [dB]; `memory`: rms difference of the autocorrelation [-].
    """
    families = {
        "metrics": float(np.mean(column_distances(real.metrics[rows], other.metrics[other_rows]))),
        "lane_keeping": float(np.mean(column_distances(real.indicators[rows], other.indicators[other_rows]))),
    }
    if real.power.shape[1]:  # else too short for any band
        level = real.power[rows].mean(axis=0) + MINIMUM_POWER
        beside = other.power[other_rows].mean(axis=0) + MINIMUM_POWER
        families["spectrum"] = float(np.sqrt(np.mean((10.0 * np.log10(beside / level)) ** 2)))
    reference, others = autocorrelation_of(real, rows), autocorrelation_of(other, other_rows)
    return families | {"memory": float(np.sqrt(np.mean((reference - others) ** 2)))}


def autocorrelation_of(features: Features, rows: IntArray) -> FloatArray:
    """About the mean of all windows; no movement at all: 1, it stays as it is. Shape (lags,). [-]"""
    mean, square = features.moments[rows].mean(axis=0)
    variance = square - mean**2
    if variance < 1e-12:
        return np.ones(features.products.shape[1])
    return np.asarray((features.products[rows].mean(axis=0) - mean**2) / variance)


def named_distances(real: Features, other: Features) -> Mapping[str, float]:
    """Distance of each metric and indicator by its name. [sd]"""
    names = (*METRICS, *INDICATORS)
    values = [*column_distances(real.metrics, other.metrics), *column_distances(real.indicators, other.indicators)]
    return dict(zip(names, values, strict=True))


def named_means(real: Features, other: Features) -> Mapping[str, tuple[float, float]]:
    """Mean of each lane-keeping indicator, real and other; units in `lane_keeping.UNITS`. [m], [s], [-]"""
    means = real.indicators.mean(axis=0).tolist(), other.indicators.mean(axis=0).tolist()
    return {name: (means[0][k], means[1][k]) for k, name in enumerate(INDICATORS)}


NEIGHBOUR_COUNT = 20  # A stand-in is drawn among so many windows of other drivers whose starts are nearest.
FLOOR_DRAWS = 4  # Sets of stand-ins with the same start that are averaged over.


def windows_with_the_same_start(
    starts: FloatArray,
    drivers: NDArray[np.generic],
    donor_starts: FloatArray,
    donor_drivers: NDArray[np.generic],
    rng: np.random.Generator,
    *,
    count: int = 1,
) -> IntArray:
    """For each window `count` others by other drivers that start at nearly the same offset: rows, shape (n, count).

    Drawn among the nearest `NEIGHBOUR_COUNT`; a driver's own windows are never taken. Raises `NotEnoughDataError` when
    other drivers have fewer than `count` windows.
    """
    chosen = np.empty((len(starts), count), dtype=np.int64)
    for row, (start, driver) in enumerate(zip(starts.tolist(), drivers.tolist(), strict=True)):
        others = np.flatnonzero(donor_drivers != driver)
        if len(others) < count:
            raise NotEnoughDataError(f"{len(others)} windows of other drivers than {driver}; {count} are needed")
        gaps = np.abs(donor_starts[others] - start)
        pool = others[np.argpartition(gaps, min(NEIGHBOUR_COUNT, len(others)) - 1)[:NEIGHBOUR_COUNT]]
        chosen[row] = rng.permutation(pool)[:count]
    return chosen


def real_against_real(
    real: Features, donors: Features, rows: IntArray, donor_rows: IntArray, stand_ins: IntArray | None
) -> dict[str, float]:
    """`differences` of real windows of other drivers; `stand_ins`, shape (n, draws): donors with the same starts."""
    if stand_ins is None:
        return differences(real, donors, rows, donor_rows)
    draws = [differences(real, donors, rows, stand_ins[:, draw]) for draw in range(stand_ins.shape[1])]
    return {name: float(np.mean([draw[name] for draw in draws])) for name in draws[0]}
