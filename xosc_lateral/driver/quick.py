"""Quick movement: what of a path is faster than drivers wander.

A place can make quick movement larger, and leaves wandering of decimetres as it is, so that both must be separated
sharply: a filter without delay looks as far ahead as back.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.convolution import convolve
from xosc_lateral.drives.filters import low_pass_between, mirrored

FloatArray = NDArray[np.float64]

BORDER = (0.1, 0.2)
"""Movement below the first is not quick, above the second all is. [Hz]"""

ATTENUATION = 40.0
"""Of wandering in what is quick: 2 mm of 20 cm. [dB]"""


@lru_cache(maxsize=8)
def slow_kernel(step: float) -> FloatArray:
    """Symmetric low-pass of gain 1 for rows `step` [s] apart, shape (2 * reach + 1,), to what is not quick. [-]"""
    kernel = low_pass_between(*BORDER, step, ATTENUATION)
    kernel.flags.writeable = False
    return kernel


def reach(step: float) -> int:
    """Rows that the filter looks ahead, and back; `step` in [s]. [-]"""
    return len(slow_kernel(step)) // 2


def quick_between(path: FloatArray, step: float) -> FloatArray:
    """What is quick of a path but for `reach` rows at both of its ends, shape (n - 2 * reach,). [unit of the path]"""
    rows = reach(step)
    return path[rows : len(path) - rows] - convolve(path, slow_kernel(step))


def quick_part(path: FloatArray, step: float) -> FloatArray:
    """What is quick of a whole path, shape (n,), continued beyond its ends by its mirror image through their points.

    In the unit of the path; nothing at the ends.
    """
    return quick_between(mirrored(path, reach(step)), step) if len(path) else path
