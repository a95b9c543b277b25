"""Who drives ahead and beside, out of the positions of all vehicles at the same instants."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray

REACH = 200.0  # [m]; who is farther away is none, as in `surroundings.around`
MAXIMUM_LENGTH = 30.0  # [m]; no vehicle is longer (German road traffic regulations: 25.25 m)


def find_neighbours(
    frame: IntArray,
    lane: IntArray,
    s: FloatArray,
    length: FloatArray,
    is_truck: BoolArray,
    *,
    lane_on_left: BoolArray,
    lane_on_right: BoolArray,
    scale: FloatArray | float = 1.0,
) -> dict[str, FloatArray]:
    """Leader in the same lane and nearest vehicle in the lanes beside: columns of the drive table, shape (n,) each.

    Distances are free space, bumper to bumper along the road, 0 while side by side; infinite where that lane has nobody
    within `REACH`, NaN where there is no such lane [m]. `*_is_truck` is 1 or 0, and 0 where there is nobody.

    `frame`: equal for rows of the same instant (and carriageway). `lane`: 0 = rightmost driving lane, counting up to
    the left; negative: in no lane. `s`: vehicle centres along the road, growing in the direction of travel. [m]
    `length`: of the vehicles. [m] `lane_on_left`, `lane_on_right`: whether there is such a lane, driven the same way.
    `scale`: metres along the own lane per metre of `s`. [-]
    """
    known = lane >= 0
    group = np.where(known, frame * 64 + lane, -1)
    order = np.lexsort((s, group))
    # One sorted axis for all groups: each gets its own, far apart from the next.
    span = float(np.ptp(s)) + 4.0 * (REACH + MAXIMUM_LENGTH) if len(s) else 1.0
    base = float(s.min()) if len(s) else 0.0
    axis = group[order] * span + (s[order] - base)

    def nearest(target: IntArray, there: BoolArray, *, ahead_only: bool = False) -> tuple[FloatArray, FloatArray]:
        place = target * span + (s - base)
        after = np.searchsorted(axis, place, side="right")
        best, truck = np.full(len(s), np.inf), np.zeros(len(s))
        for candidate in (after,) if ahead_only else (after, after - 1):
            inside = (candidate >= 0) & (candidate < len(axis)) & known
            who = order[np.clip(candidate, 0, len(axis) - 1)]
            free = np.maximum(scale * np.abs(s[who] - s) - 0.5 * (length[who] + length), 0.0)
            gap = np.where(inside & (group[who] == target), free, np.inf)
            closer = (gap < best) & (gap <= REACH)
            best, truck = np.where(closer, gap, best), np.where(closer, is_truck[who], truck)
        return np.where(there & known | np.isfinite(best), best, np.nan), truck

    found = {
        "lead": nearest(group, known, ahead_only=True),
        "left": nearest(np.where(known, group + 1, -2), lane_on_left),
        "right": nearest(np.where(known & (lane > 0), group - 1, -2), lane_on_right),
    }
    return {
        f"{who}_{what}": values
        for who, both in found.items()
        for what, values in zip(("distance", "is_truck"), both, strict=True)
    }
