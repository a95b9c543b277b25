"""Movement below 0.5 Hz, or below what a recording is valid to: what drivers do, without most of what cameras add.

Nothing faster is left to see. A logarithm of power sees a tenth of a millimetre as well as a metre, so that a filter
which is still closing at 0.5 Hz shows a classifier what lies above.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between

STOP_FREQUENCY = (
    0.5  # Where the stop band begins. Drivers steer against what they see below it; beyond it cameras show. [Hz]
)
PASS_FREQUENCY = 0.4  # Where the pass band ends: the filter sees 11 s to each side, a quarter of most runs. [Hz]
# Of the stop band: noise of 1 cm becomes 0.1 mm, far less than a difference between two models. [dB]
ATTENUATION = 40.0


def comparison_band(runs: Sequence[Run]) -> float:
    """Frequency below which movement is compared: half a hertz, or what the recording is valid to. [Hz]"""
    return min([STOP_FREQUENCY, *(run.valid_below for run in runs if run.valid_below is not None)])


def slow_movement(path: FloatArray, step: float, stop: float = STOP_FREQUENCY) -> FloatArray:
    """A path without its movement above a frequency [Hz].

    `path`, shape (n,) [m], is evenly in time, and continued beyond its ends by its mirror image through the end point.
    With a `step` [s] that shows nothing above the frequency it stays as it is.
    """
    if len(path) < 2 or 0.5 / step <= stop:
        return np.array(path)
    return filtered(path, low_pass_between(PASS_FREQUENCY / STOP_FREQUENCY * stop, stop, step, ATTENUATION))


def thinned(paths: FloatArray, step: float, stop: float = STOP_FREQUENCY) -> FloatArray:
    """Filtered paths, shape (n, m), without the rows that would show leftovers of the stop band alone. [m]

    Half their rate is the beginning of the stop band.
    """
    return paths[:, :: max(1, round(0.5 / stop / step))]


def dithered(paths: Sequence[FloatArray], resolution: float, seed: int) -> list[FloatArray]:
    """Paths with even noise as wide as a recording's resolution [m]: what is finer can't be told from rounding."""
    if resolution <= 0.0:
        return list(paths)
    root = np.random.SeedSequence(seed).spawn(len(paths))
    return [
        path + resolution * (np.random.default_rng(own).random(len(path)) - 0.5)
        for path, own in zip(paths, root, strict=True)
    ]


def resolution_of(runs: Sequence[Run]) -> float:
    """The coarsest that runs state; 0 where none does. [m]"""
    return max((run.resolution for run in runs if run.resolution is not None), default=0.0)
