"""How much quick movement a recording shows in each of its zones, whoever passes.

Cameras beside the road, and how well a road's centre is known, differ from place to place, and a place is the same for
all who pass it. Looked at is the jerk, whose power is nearly even from 0.1 to 0.5 Hz: its mean square in a passage of
some seconds is better known than that of the offset, or of the acceleration, which hangs on its slowest part. What
class, lane and speed do to it, and each driver, is separated from the zones (`zone_levels`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.digits import all_significant
from xosc_lateral.driver.effects import Acts, Zones
from xosc_lateral.driver.quick import BORDER, quick_part
from xosc_lateral.driver.zone_levels import Passages, zone_levels
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.drives.zones import passages

FloatArray = NDArray[np.float64]

LEAST = round(0.5 / BORDER[1] / STEP)
"""Rows of a passage: half a period of the slowest quick movement. [-]"""

SMOOTHING, ORDER = 0.125 / BORDER[1], 2
"""Lags, one after the other, that take one zone's level into the next one's: a quarter of that period in all, and as
long before the border as after it. A level that jumps would make the path jump. [s], [-]"""

DERIVATIVE = 3
"""Of the path, that its jerk is. [-]"""

FAINTEST = 1e-12
"""Added to mean squares, so that none at all has a logarithm. [m2]"""


def quick_by_zone(runs: Sequence[Run], beside: Callable[[Run], FloatArray]) -> list[Zones]:
    """What each zone does to quick movement; none where that is no more than chance, or no run knows its zones.

    Parameters
    ----------
    runs : sequence of Run
    beside : callable
        What else the movement may go with, shape (n, k) of a run of n rows.
    """
    level, zone, drive, other = list[float](), list[str](), list[str](), list[FloatArray]()
    for run in runs:
        those = [] if run.zone is None else passages(run.zone[:-DERIVATIVE], LEAST)
        if not those:
            continue
        jerk, quantities = np.diff(quick_part(run.offset, STEP), DERIVATIVE), beside(run)
        for name, rows in those:
            level.append(float(np.log((jerk[rows] ** 2).mean() + FAINTEST)))
            zone.append(name)
            drive.append(run.drive)
            other.append(quantities[rows].mean(axis=0))
    found = zone_levels(Passages(np.array(level), zone, drive, np.array(other))) if level else None
    if found is None:
        return []
    # Of the logarithm of power, which is twice that of size.
    values, errors = (all_significant((0.5 * part).tolist(), 6) for part in (found.values, found.errors))
    return [
        Zones(
            acts=Acts.QUICK,
            zones=found.names,
            values=values,
            value_errors=errors,
            lag_s=-ORDER * SMOOTHING,
            response_s=SMOOTHING,
            response_order=ORDER,
        )
    ]
