"""Movement below 0.5 Hz: what drivers do, without most of what cameras add.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.filters import kaiser_design, low_pass

FloatArray = NDArray[np.float64]

CUTOFF = 0.5
"""Half the amplitude is left. Drivers steer against what they see below it; beyond it cameras show. [Hz]"""

TRANSITION = 0.2
"""From the end of the pass band, 0.4 Hz, to the beginning of the stop band, 0.6 Hz. [Hz]"""

ATTENUATION = 40.0
"""Of the stop band: noise of 1 cm becomes 0.1 mm, far less than a difference between two models. [dB]"""


THINNED = 0.8
"""Seconds between values that say all about what is left: half that rate is the end of the stop band. [s]"""


def below_half_hertz(path: FloatArray, step: float) -> FloatArray:
    """A path without its movement above 0.5 Hz.

    Parameters
    ----------
    path : array, shape (n,)
        Evenly in time; continued beyond its ends by its mirror image through the end point. [m]
    step : float
        [s]

    Returns
    -------
    array, shape (n,)
        [m]
    """
    nyquist = 0.5 / step
    half, beta = kaiser_design(ATTENUATION, TRANSITION / nyquist)
    kernel = low_pass(half, CUTOFF / nyquist, beta)
    if len(path) < 2:
        return np.array(path)
    return np.convolve(np.pad(path, half, mode="reflect", reflect_type="odd"), kernel, mode="valid")


def thinned(paths: FloatArray, step: float) -> FloatArray:
    """Filtered paths, shape (n, m), without the rows that would show leftovers of the stop band alone. [m]"""
    return paths[:, :: max(1, round(THINNED / step))]
