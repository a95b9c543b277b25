"""Movement below 0.5 Hz: what drivers do, without most of what cameras add.

Nothing faster is left to see. A logarithm of power sees a tenth of a millimetre as well as a metre, so that a filter
which is still closing at 0.5 Hz shows a classifier what lies above.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between

STOP_FREQUENCY = (
    0.5  # Where the stop band begins. Drivers steer against what they see below it; beyond it cameras show. [Hz]
)
PASS_FREQUENCY = 0.4  # Where the pass band ends: the filter sees 11 s to each side, a quarter of most runs. [Hz]
# Of the stop band: noise of 1 cm becomes 0.1 mm, far less than a difference between two models. [dB]
ATTENUATION = 40.0
# Seconds between values that say all about what is left: half that rate is the beginning of the stop band. [s]
THINNED = 0.5 / STOP_FREQUENCY


def below_half_hertz(path: FloatArray, step: float) -> FloatArray:
    """A path without its movement above 0.5 Hz.

    `path`, shape (n,) [m], is evenly in time, and continued beyond its ends by its mirror image through the end point.
    With a `step` [s] that shows nothing above 0.5 Hz it stays as it is.
    """
    if len(path) < 2 or 0.5 / step <= STOP_FREQUENCY:
        return np.array(path)
    return filtered(path, low_pass_between(PASS_FREQUENCY, STOP_FREQUENCY, step, ATTENUATION))


def thinned(paths: FloatArray, step: float) -> FloatArray:
    """Filtered paths, shape (n, m), without the rows that would show leftovers of the stop band alone. [m]"""
    return paths[:, :: max(1, round(THINNED / step))]
