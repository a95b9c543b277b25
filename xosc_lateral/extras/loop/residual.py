"""The residual: where measured drives and a profile's own runs under the same context differ, in metres.

Both are described by the same summary statistics: the mean offset and the spread of the faster movement in each fifth
of every context column, and where it says that there is none; the spread in each sixth of the drive, the movement's
size in bands of frequency, and quantiles of the local spread. The error is the root mean square over them of measured
minus expected, with the expectation taken over several runs of the profile, as in the method of simulated moments [1]_.
It stands beside the sampling error of what is measured, by half samples of the drives' blocks [2]_.

References
----------
.. [1] D. McFadden, "A method of simulated moments for estimation of discrete response models without numerical
       integration", Econometrica 57, 1989.
.. [2] P. J. McCarthy, "Pseudo-replication: half samples", Review of the International Statistical Institute 37, 1969.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import in_digits
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.extras.loop.timeline import LOCAL_S, PAD, Timeline, local_mean, missing_throughout

N_BINS = 5  # Bins of a column, equally filled.
RESPONSE_S = 2.0  # Columns are smoothed as a driver responds before they are binned. [s]
BANDS_S = (1.0, 3.0, 8.0, 20.0, 60.0, 200.0)  # Averaging times between which the bands of the movement lie. [s]
# Name of that group, and frequencies to each side that belong to it. [-]
OSCILLATION, LINE_WIDTH = "movement at the weave's period", 2
LOCAL_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
N_RUNS = 24  # Runs of the profile that its expectation is taken over ...
FEW_RUNS, MANY_DRIVES = 6, 50  # ... and how many with so many drives, each of which is another sample already.
HALF_SAMPLES = 64  # Of the blocks: the standard error of a share of 5 % of them is 3 %.
TIME_PARTS = 6  # Parts of a drive by which the spread over time is compared: seven minutes of forty.
LEVEL = 0.05  # Share of them that may be as far off as the refined profile. [-]
SPARE_ROWS = 75  # A bin with fewer rows (15 s) than this is left out. [-]


@dataclass(frozen=True, eq=False)
class SummaryStatistics:
    """What is compared, once for measured and sampled offsets alike."""

    timeline: Timeline
    labels: Mapping[str, IntArray]  # shape (n,): Bin of every row by group (a column's name, "time", ...), -1: none.
    middles: Mapping[str, FloatArray]  # Mean of the quantity per bin, for curves.
    oscillation: float | None = None  # Frequency of a cycle that was found. [1/s]

    def describe(self, offset: FloatArray, used: BoolArray) -> dict[str, FloatArray]:
        """Statistics of one series of offsets on the grid, shape (n,), by group. [m]"""
        timeline = self.timeline
        used = used & timeline.valid
        slow = local_mean(offset, timeline.valid, LOCAL_S)
        fast = offset - slow
        statistics: dict[str, FloatArray] = {}
        for name, label in self.labels.items():
            mean, spread = _by_bin(offset, label, used), np.sqrt(_by_bin(fast**2, label, used))
            if name != "time":
                statistics[f"mean by {name}"] = mean
            statistics[f"spread by {name}"] = spread
        statistics["movement by band"] = _bands(offset, used, timeline)
        if self.oscillation is not None:
            statistics[OSCILLATION] = np.array([_amplitude(offset, used, timeline, self.oscillation)])
        local = np.sqrt(local_mean(fast**2, timeline.valid, LOCAL_S))
        inside = local[used]
        statistics["quantiles of local spread"] = (
            np.quantile(inside, LOCAL_QUANTILES) if len(inside) else np.full(len(LOCAL_QUANTILES), np.nan)
        )
        return statistics

    def shares(self, half: BoolArray) -> dict[str, FloatArray]:
        """Share of each bin's rows that are in a part of them, shape (n,), by group of statistics. [-]"""
        shares = {}
        for name, label in self.labels.items():
            inside, size = self.timeline.valid & (label >= 0), int(label.max()) + 1
            total = np.bincount(label[inside], minlength=size)
            share = np.bincount(label[inside & half], minlength=size) / np.maximum(total, 1)
            shares[f"mean by {name}"] = shares[f"spread by {name}"] = share
        return shares


def statistics_of(
    timeline: Timeline, quantities: Mapping[str, FloatArray], oscillation: float | None = None
) -> SummaryStatistics:
    """Bins for every quantity, shape (n,) each, and for time; an oscillation's frequency [1/s], if any."""
    labels, middles = {}, {}
    for name, values in quantities.items():
        none, seen = np.isnan(values), values[timeline.valid & np.isfinite(values)]
        # the mean where there is none, the farthest where nobody is within reach
        usual, farthest = (seen.mean(), seen.max()) if len(seen) else (0.0, 0.0)
        filled = np.nan_to_num(values, nan=usual, posinf=farthest, neginf=usual)
        label, middle = _binned(in_digits(timeline.respond(filled, 0.0, RESPONSE_S)), timeline.valid, none)
        label[missing_throughout(values, timeline)] = -1
        if len(middle) > 1:
            labels[name], middles[name] = label, middle
    labels["time"], middles["time"] = _time_bins(timeline)
    return SummaryStatistics(timeline, labels, middles, oscillation)


def simulated_runs(
    profile: DriverProfile,
    timeline: Timeline,
    seed: np.random.SeedSequence,
    *,
    runs: int | None = None,
    held: BoolArray | None = None,
) -> FloatArray:
    """Free runs of a profile under the drives' context, shape (runs, n) [m]; without drives that have no row `held`."""
    if runs is None:
        runs = FEW_RUNS if len(timeline.names) >= MANY_DRIVES else N_RUNS
    result = np.zeros((runs, len(timeline)))
    context = {"lane_width": timeline.lane_width, **timeline.context}
    speed = context.get("speed", np.full(len(timeline), np.nan))
    for index, span in enumerate(timeline.spans):
        if held is not None and not held[span].any():
            continue
        segment = Segment(
            time=timeline.time[span.start] + timeline.step * np.arange(span.stop - span.start),
            lane_width=timeline.lane_width[span],
            speed=speed[span],
            context={name: values[span] for name, values in context.items()},
            before=PAD,
            after=PAD,
        )
        for run in range(runs):
            offset = OffsetSampler(profile, child(seed, run, index)).sample(segment)
            result[run, span.start + PAD : span.stop - PAD] = offset
    return result


def expected(statistics: SummaryStatistics, runs: FloatArray, used: BoolArray) -> dict[str, FloatArray]:
    """Mean of the statistics over a profile's runs, shape (runs, n). [m]"""
    several = [statistics.describe(run, used) for run in runs]
    return {name: np.mean([one[name] for one in several], axis=0) for name in several[0]}


def error_between(first: Mapping[str, FloatArray], second: Mapping[str, FloatArray]) -> float:
    """Size of the difference of two descriptions, as `size_of` has it. [m]"""
    return size_of({name: values - second[name] for name, values in first.items()})


def half_samples(
    statistics: SummaryStatistics, offset: FloatArray, blocks: IntArray, rng: np.random.Generator
) -> list[dict[str, FloatArray]]:
    """Random halves of the blocks less all of them, which vary as all about the truth [2]_."""
    valid = statistics.timeline.valid
    numbers, whole = np.unique(blocks[valid]), statistics.describe(offset, valid)
    differences = []
    for _ in range(HALF_SAMPLES):
        rows = np.isin(blocks, rng.permutation(numbers)[: len(numbers) // 2])
        half, shares = statistics.describe(offset, rows), statistics.shares(rows)
        # a share p of the rows less all of them has a variance of (1 - p) / p times that of all
        odds = {name: share / np.maximum(1.0 - share, 1e-9) for name, share in shares.items()}
        differences.append(
            {name: (values - whole[name]) * np.sqrt(odds.get(name, 1.0)) for name, values in half.items()}
        )
    return differences


def size_of(differences: Mapping[str, FloatArray]) -> float:
    """Root mean square over groups of summary statistics, >= 0, each group's mean square counting the same. [m]"""
    squares = [float(np.mean(seen**2)) for values in differences.values() if len(seen := values[np.isfinite(values)])]
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


@dataclass(frozen=True, slots=True)
class GroupError:
    """Root mean square of measured minus expected over one group of statistics, and its sampling error. [m]"""

    name: str
    before: float
    after: float
    floor: float


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """What is left beside the sampling error of what is measured: by statistic, by group, and over all. [m]"""

    floors: Mapping[str, FloatArray]
    groups: tuple[GroupError, ...]
    floor: float


def lack_of_fit_of(
    real: Mapping[str, FloatArray],
    before: Mapping[str, FloatArray],
    after: Mapping[str, FloatArray],
    halves: Sequence[Mapping[str, FloatArray]],
) -> LackOfFit:
    """Compare what both profiles lack with what half samples of the drives differ by; by group, shape (statistics,)."""
    floors = {name: np.sqrt(_mean_of_finite(np.stack([half[name] for half in halves]) ** 2)) for name in real}
    groups = tuple(
        GroupError(
            name,
            size_of({name: values - before[name]}),
            size_of({name: values - after[name]}),
            size_of({name: floors[name]}),
        )
        for name, values in real.items()
    )
    return LackOfFit(floors, groups, float(np.mean([size_of(half) for half in halves])))


def _mean_of_finite(values: FloatArray) -> FloatArray:
    count = np.isfinite(values).sum(axis=0)
    return np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan)


def _by_bin(values: FloatArray, label: IntArray, used: BoolArray) -> FloatArray:
    inside = used & (label >= 0)
    size = int(label.max()) + 1
    count = np.bincount(label[inside], minlength=size)
    sums = np.bincount(label[inside], values[inside], minlength=size)
    return np.where(count >= SPARE_ROWS, sums / np.maximum(count, 1), np.nan)


def _bands(offset: FloatArray, used: BoolArray, timeline: Timeline) -> FloatArray:
    if not used.any():
        return np.full(len(BANDS_S) + 1, np.nan)
    levels = (offset, *(local_mean(offset, timeline.valid, seconds) for seconds in BANDS_S))
    inside = [level[used] for level in levels]
    return np.array([*[np.std(finer - coarser) for finer, coarser in pairwise(inside)], np.std(inside[-1])])


def _amplitude(offset: FloatArray, used: BoolArray, timeline: Timeline, frequency: float) -> float:
    """Amplitude of an oscillation of about that frequency: root mean square over drives, of the lines around it. [m]"""
    squares = 0.0
    for span in timeline.spans:
        rows = np.flatnonzero(used[span])
        if len(rows):
            seen = offset[span][rows]
            around = frequency + np.arange(-LINE_WIDTH, LINE_WIDTH + 1) / ((span.stop - span.start) * timeline.step)
            lines = np.exp(-2j * np.pi * np.outer(around, rows * timeline.step)) @ (seen - seen.mean())
            squares += float(np.sum(np.abs(2.0 * lines / len(rows)) ** 2)) * len(rows)
    return float(np.sqrt(squares / max(int(used.sum()), 1)))


def _binned(values: FloatArray, valid: BoolArray, none: BoolArray) -> tuple[IntArray, FloatArray]:
    """Fifths of what there is, then a bin of its own where there is none; with the mean of each, NaN for that one."""
    seen = values[valid & ~none]
    edges = np.unique(np.quantile(seen, np.linspace(0.0, 1.0, N_BINS + 1)[1:-1])) if len(seen) else np.zeros(0)
    label = np.searchsorted(edges, values, side="right")
    if len(edges) and float(np.mean(seen >= edges[-1])) < 0.01:
        label = np.minimum(label, len(edges) - 1)
    label = np.where(none, len(edges) + 1, label)
    used, label = np.unique(label, return_inverse=True)
    inside = [valid & ~none & (label == index) for index in range(len(used))]
    return label.astype(np.intp), np.array([values[rows].mean() if rows.any() else np.nan for rows in inside])


def _time_bins(timeline: Timeline) -> tuple[IntArray, FloatArray]:
    label = np.full(len(timeline), -1, dtype=np.intp)
    for span in timeline.spans:
        rows = np.arange(span.start, span.stop)
        inside = rows[timeline.valid[rows]]
        if len(inside):
            share = (rows - inside[0]) / max(1, inside[-1] - inside[0] + 1)
            label[rows] = np.clip((share * TIME_PARTS).astype(np.intp), 0, TIME_PARTS - 1)
    return label, (np.arange(TIME_PARTS) + 0.5) / TIME_PARTS
