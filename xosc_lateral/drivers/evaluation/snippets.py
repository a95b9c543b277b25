"""Measured snippets of one length as arrays, and the same snippets sampled from a profile.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: snippets of 10 s, each sampled one from its real one's start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.metrics import Distances, metric_distances, snippet_metrics
from xosc_lateral.drivers.evaluation.spectra import STOP_FREQUENCY
from xosc_lateral.drivers.fitting.models.two_level import split_levels
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.core.two_level.model import PAPER_SETTINGS
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import Snippet, cut_snippets, recorded_offsets, segment_of, sensor_error
from xosc_lateral.drivers.model.sampling import OffsetSampler, sample_offsets
from xosc_lateral.drivers.model.seeds import child

BLOCK = 120.0  # Where there are too few drives to split between them, blocks of this length are split instead. [s]
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

    def take(self, rows: NDArray[np.int64]) -> Snippets:
        """Some of them. `rows` of shape (k,). [-]"""
        chosen = rows.tolist()
        return Snippets(
            self.seconds,
            tuple(self.items[row] for row in chosen),
            self.offset[rows],
            self.lane_width[rows],
            self.group[rows],
            tuple(self.place[row] for row in chosen),
        )

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
    block = max(BLOCK, 2.0 * seconds)
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


def sample_parts(profile: DriverProfile, snippets: Snippets, seed: int) -> tuple[FloatArray, FloatArray]:
    """Coarse and fine part of sampled snippets, without effects, in lane widths; shape (n, m) each. [-]"""
    root = np.random.SeedSequence(seed)
    relative = snippets.offset / snippets.lane_width
    coarse, fine = np.empty_like(relative), np.empty_like(relative)
    for k, start in enumerate(relative[:, 0].tolist()):
        stream = profile.model.stream(child(root, k), Start(rel_offset=start))
        coarse[k], fine[k] = stream.take(relative.shape[1])
    return coarse, fine


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
    of_drive: dict[str, list[int]] = {}
    for k in sorted(range(len(runs)), key=lambda k: float(runs[k].time[0])):
        of_drive.setdefault(runs[k].drive, []).append(k)
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
    coarse, fine = sample_parts(profile, snippets, seed)
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
