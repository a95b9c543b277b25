"""The paper's four evaluations: coarse and fine part, each measured or sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation.distances import Distances, metric_distances
from xosc_lateral.drivers.evaluation.filters import STOP_FREQUENCY
from xosc_lateral.drivers.evaluation.metrics import snippet_metrics
from xosc_lateral.drivers.evaluation.snippets import Snippets, sample_parts
from xosc_lateral.drivers.fitting.models.two_level import split_levels
from xosc_lateral.drivers.model.core.two_level.model import PAPER_SETTINGS
from xosc_lateral.drivers.model.profile import DriverProfile

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
    coarse_real, fine_real = _real_parts(snippets)
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
    return tuple(_compared(number, *each, real) for number, each in enumerate(combinations, start=1))


def _compared(number: int, coarse_from: str, fine_from: str, rows: FloatArray, real: FloatArray) -> PartEvaluation:
    """Snippets [m], shape (n, m), put together from parts, beside the measured ones' metrics."""
    artificial = snippet_metrics(rows)
    return PartEvaluation(number, coarse_from, fine_from, real, artificial, metric_distances(real, artificial))


def _real_parts(snippets: Snippets) -> tuple[FloatArray, FloatArray]:
    """The paper's split of the measured snippets, made on whole runs so that only a run's ends are ends."""
    runs = {id(one.run): one.run for one in snippets.items}
    split = {key: split_levels(run.rel_offset, PAPER_SETTINGS) for key, run in runs.items()}
    coarse = np.array([split[id(one.run)][0][one.rows] for one in snippets.items])
    fine = np.array([split[id(one.run)][1][one.rows] for one in snippets.items])
    return coarse, fine
