"""What traffic psychology, lane keeping assistance and UN R157 read in a stretch of driving, window by window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.cuts import HALF_WIDTH
from xosc_lateral.evaluation.line_crossing import time_to_line_crossing
from xosc_lateral.evaluation.margins import NEAR_MARKING

FloatArray = NDArray[np.float64]

INDICATORS = (
    "sdlp",
    "tlc_min",
    "tlc_median",
    "beyond_wandering_zone",
    "near_marking",
    "lateral_acceleration",
    "lateral_jerk",
)
"""Columns of `lane_keeping_indicators`."""

UNITS = ("m", "s", "s", "-", "-", "m/s2", "m/s3")

WANDERING_ZONE = 0.375
"""UN R157, guidance on performance models: a neighbour this far from its lane's centre is no longer wandering. [m]"""


def lane_keeping_indicators(
    offset: FloatArray, lane_width: FloatArray, step: float, *, half_width: float = HALF_WIDTH
) -> FloatArray:
    """Indicators of each window.

    Parameters
    ----------
    offset, lane_width : array, shape (n, m)
        One window a row, m >= 4. [m]
    step : float
        [s]
    half_width : float
        Of the vehicles. [m]

    Returns
    -------
    array, shape (n, 7)
        Columns as in `INDICATORS`, units as in `UNITS`: standard deviation of lateral position [1]_; smallest and
        median time to line crossing [2]_; shares of time beyond the wandering zone of UN R157 [3]_ and near a marking;
        root mean square of lateral acceleration and jerk, from differences of the offset (no steering in them).

    References
    ----------
    .. [1] J. F. O'Hanlon et al., "Diazepam impairs lateral position control in highway driving", Science 217, 1982.
    .. [2] W. van Winsum, K. A. Brookhuis, D. de Waard, "A comparison of different ways to approximate time-to-line
       crossing (TLC) during car driving", Accident Analysis & Prevention 32, 2000: here distance over lateral speed.
    .. [3] UN Regulation No. 157, guidance on performance models, cut-in scenario.
    """
    crossing = time_to_line_crossing(offset, lane_width, step, half_width=half_width)
    acceleration = np.diff(offset, 2, axis=1) / step**2
    jerk = np.diff(offset, 3, axis=1) / step**3
    near = np.abs(offset) > 0.5 * lane_width - NEAR_MARKING
    return np.column_stack(
        [
            offset.std(axis=1),
            crossing.min(axis=1),
            np.median(crossing, axis=1),
            (np.abs(offset) > WANDERING_ZONE).mean(axis=1),
            near.mean(axis=1),
            np.sqrt((acceleration**2).mean(axis=1)),
            np.sqrt((jerk**2).mean(axis=1)),
        ]
    )
