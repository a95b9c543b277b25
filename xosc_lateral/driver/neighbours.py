"""What vehicles in the neighbouring lanes do to a population's level: drivers keep away from whom they are beside.

The effect fades exponentially with the free space lengthwise, and is none where there is nobody. How strong it is on
either side is found in the fit (`place`); its form was found in DLR Highway Traffic v1.1.0
(benchmarks/neighbour_response.py): of those within 0.5 % of the variance of the best, one that is not too quick, and
without a corner.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.driver.effects import Acts, Proximity
from xosc_lateral.drives.drive import Run

NEIGHBOURS = ("left_distance", "right_distance")
"""Free space lengthwise to the nearest vehicle in the lane to the left and to the right [m]; NaN or infinite: none."""

SCALE = 40.0
"""Free space over which the effect fades to 37 %. [m]"""

LAG, RESPONSE, ORDER = -1.0, 1.0, 2
"""Delay, and two first-order lags: drivers see neighbours coming, and nobody moves at once. After a single lag of 2 s
somebody who comes into the lane would be a corner in the path, which no car can drive. [s], [s], [-]"""


def neighbour_shapes(runs: Sequence[Run], least: int) -> list[Proximity]:
    """Effects without coefficients, of each side on which so many drives have somebody within `SCALE`."""
    return [
        Proximity(acts=Acts.LOCATION, column=name, scale=SCALE, lag_s=LAG, response_s=RESPONSE, response_order=ORDER)
        for name in NEIGHBOURS
        if len(_drives_beside(runs, name)) >= least
    ]


def most_beside(runs: Sequence[Run]) -> int:
    """How many drives have somebody within `SCALE`, on the side on which more do."""
    return max(len(_drives_beside(runs, name)) for name in NEIGHBOURS)


def _drives_beside(runs: Sequence[Run], column: str) -> set[str]:
    return {run.drive for run in runs if column in run.context and (np.abs(run.context[column]) <= SCALE).any()}
