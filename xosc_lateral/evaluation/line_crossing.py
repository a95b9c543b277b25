"""Time to line crossing, as warning systems reckon it.

References
----------
.. [1] W. van Winsum, K. A. Brookhuis, D. de Waard, "A comparison of different ways to approximate time-to-line
       crossing (TLC) during car driving", Accident Analysis & Prevention 32, 2000: here distance over lateral speed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.cuts import HALF_WIDTH

FloatArray = NDArray[np.float64]

LONGEST_TLC = 20.0
"""Times to line crossing beyond it count as it: far above the 2 s that warning systems look at. [s]"""


def time_to_line_crossing(
    offset: FloatArray, lane_width: FloatArray, step: float, *, half_width: float = HALF_WIDTH
) -> FloatArray:
    """Time until the side that the vehicle moves towards reaches its marking, at constant lateral speed.

    Parameters
    ----------
    offset, lane_width : array, shape (..., m)
        [m]

    Returns
    -------
    array, shape (..., m - 1)
        0 where the side is beyond the marking already, at most `LONGEST_TLC`. [s]
    """
    speed = np.diff(offset, axis=-1) / step
    towards = np.sign(speed) * offset[..., 1:]
    room = np.maximum(0.5 * lane_width[..., 1:] - half_width - towards, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(speed == 0.0, np.inf, room / np.abs(speed))
    return np.minimum(time, LONGEST_TLC)
