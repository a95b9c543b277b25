"""Measured runs cut into snippets of one length, and the same snippets sampled from a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.core import Start
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import OffsetSampler
from xosc_lateral.driver.seeds import child
from xosc_lateral.driver.series import Run
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

LOOK_BACK = 300
"""Rows of context that a snippet brings along from before it: 60 s at 5 Hz."""
LOOK_AHEAD = 50
"""And from after it: 10 s."""

BLOCK = 120.0
"""Where there are too few drives to split between them, blocks of this length are split instead. [s]"""
FEW_DRIVES = 6


@dataclass(frozen=True, eq=False)
class Snippets:
    """Snippets of measured driving.

    Parameters
    ----------
    offset : array, shape (n, m)
        [m]
    lane_width : array, shape (n, m)
        [m]
    group : array of str, shape (n,)
        Drive, or block of a drive: what is split between halves as a whole.
    run, first : array of int, shape (n,)
        Which run each comes from, and its first row there.
    """

    offset: FloatArray
    lane_width: FloatArray
    group: NDArray[np.str_]
    run: NDArray[np.int64]
    first: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.offset)


def snippets_of(runs: Sequence[Run], seconds: float, step: float) -> Snippets:
    """All whole snippets, one after the other in each run; both ends count (51 values for 10 s at 5 Hz)."""
    length = round(seconds / step) + 1
    by_block = len({run.drive for run in runs}) < FEW_DRIVES
    block = max(BLOCK, 2.0 * seconds)
    # Neighbouring snippets share the row at which they meet, as in the paper's 10 s windows of 51 values.
    places = [(k, a) for k, run in enumerate(runs) for a in range(0, len(run) - length + 1, length - 1)]
    groups = [f"{runs[k].drive} #{int(runs[k].time[a] // block)}" if by_block else runs[k].drive for k, a in places]
    return Snippets(
        offset=np.array([runs[k].offset[a : a + length] for k, a in places]).reshape(-1, length),
        lane_width=np.array([runs[k].lane_width[a : a + length] for k, a in places]).reshape(-1, length),
        group=np.array(groups, dtype=np.str_),
        run=np.array([k for k, _ in places], dtype=np.int64),
        first=np.array([a for _, a in places], dtype=np.int64),
    )


def run_segment(run: Run, first: int = 0, length: int | None = None) -> Segment:
    """Rows of a run as a segment to be sampled, with the context around them."""
    last = len(run) if length is None else first + length
    begin, end = max(0, first - LOOK_BACK), min(len(run), last + LOOK_AHEAD)
    rows = slice(begin, end)
    speed = run.speed
    return Segment(
        time=run.time[rows],
        lane_width=run.lane_width[rows],
        # Unknown speed is no speed that effects could read: they read the context, where it is absent.
        speed=np.zeros(end - begin) if speed is None else speed[rows],
        context={name: values[rows] for name, values in run.context.items()},
        before=first - begin,
        after=end - last,
    )


def sample_snippets(profile: DriverProfile, runs: Sequence[Run], snippets: Snippets, seed: int) -> FloatArray:
    """For each snippet one of a new driver, of the same length, start and context. Shape (n, m). [m]"""
    root = np.random.SeedSequence(seed)
    length = snippets.offset.shape[1]
    sampled = np.empty_like(snippets.offset)
    for k in range(len(snippets)):
        segment = run_segment(runs[snippets.run[k]], int(snippets.first[k]), length)
        sampler = OffsetSampler(profile, child(root, k))
        sampled[k] = sampler.sample(segment, start=float(snippets.offset[k, 0]))
    return sampled


def sample_parts(profile: DriverProfile, snippets: Snippets, seed: int) -> tuple[FloatArray, FloatArray]:
    """Coarse and fine part of sampled snippets without effects, in lane widths; shape (n, m) each."""
    root = np.random.SeedSequence(seed)
    relative = snippets.offset / snippets.lane_width
    coarse, fine = np.empty_like(relative), np.empty_like(relative)
    for k in range(len(snippets)):
        stream = profile.model.stream(child(root, k, 0), Start(rel_offset=float(relative[k, 0])))
        coarse[k], fine[k] = stream.take(relative.shape[1])
    return coarse, fine


def sample_runs(profile: DriverProfile, runs: Sequence[Run], seed: int) -> list[FloatArray]:
    """For each run one of the same length, start and context; runs of one drive are of one driver's seed apart. [m]"""
    root = np.random.SeedSequence(seed)
    return [
        OffsetSampler(profile, child(root, k)).sample(run_segment(run), start=float(run.offset[0]))
        for k, run in enumerate(runs)
    ]
