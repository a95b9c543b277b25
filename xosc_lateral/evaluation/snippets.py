"""Measured snippets of one length as arrays, and the same snippets sampled from a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.base import Start
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import sample_offsets
from xosc_lateral.driver.seeds import child
from xosc_lateral.driver.snippets import Snippet, cut_snippets, segment_of
from xosc_lateral.drives.drive import Run

FloatArray = NDArray[np.float64]

BLOCK = 120.0
"""Where there are too few drives to split between them, blocks of this length are split instead. [s]"""
FEW_DRIVES = 6


@dataclass(frozen=True, eq=False)
class Snippets:
    """Snippets of measured driving.

    Parameters
    ----------
    items : tuple of Snippet
        Where each comes from.
    offset, lane_width : array, shape (n, m)
        [m]
    group : array of str, shape (n,)
        Drive, or block of a drive: what is split between halves as a whole.
    """

    items: tuple[Snippet, ...]
    offset: FloatArray
    lane_width: FloatArray
    group: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.items)


def snippets_of(runs: Sequence[Run], seconds: float, step: float) -> Snippets:
    """All whole snippets, one after the other in each run, both ends counted (51 values for 10 s at 5 Hz)."""
    length = round(seconds / step) + 1
    items = tuple(cut_snippets(runs, seconds, step)) if any(len(run) >= length for run in runs) else ()
    by_block = len({run.drive for run in runs}) < FEW_DRIVES
    block = max(BLOCK, 2.0 * seconds)
    groups = [f"{one.run.drive} {int(one.time[0] // block)}" if by_block else one.run.drive for one in items]
    return Snippets(
        items,
        np.array([one.offset for one in items]).reshape(-1, length),
        np.array([one.run.lane_width[one.rows] for one in items]).reshape(-1, length),
        np.array(groups, dtype=np.str_),
    )


def sample_snippets(profile: DriverProfile, snippets: Snippets, seed: int) -> FloatArray:
    """For each snippet one of a new driver, of the same length, start and context. Shape (n, m). [m]"""
    root = np.random.SeedSequence(seed)
    return np.array(
        [
            sample_offsets(profile, segment_of(one.run, one.rows), child(root, k), start=float(one.offset[0]))
            for k, one in enumerate(snippets.items)
        ]
    )


def sample_parts(profile: DriverProfile, snippets: Snippets, seed: int) -> tuple[FloatArray, FloatArray]:
    """Coarse and fine part of sampled snippets, without effects, in lane widths; shape (n, m) each."""
    root = np.random.SeedSequence(seed)
    relative = snippets.offset / snippets.lane_width
    coarse, fine = np.empty_like(relative), np.empty_like(relative)
    for k, start in enumerate(relative[:, 0].tolist()):
        stream = profile.model.stream(child(root, k), Start(rel_offset=start))
        coarse[k], fine[k] = stream.take(relative.shape[1])
    return coarse, fine


def sample_runs(profile: DriverProfile, runs: Sequence[Run], seed: int) -> list[FloatArray]:
    """For each run one of a new driver, of the same length, start and context. [m]"""
    root = np.random.SeedSequence(seed)
    return [
        sample_offsets(profile, segment_of(run), child(root, k), start=float(run.offset[0]))
        for k, run in enumerate(runs)
    ]
