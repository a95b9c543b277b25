"""Who drives ahead and beside, out of the positions of all vehicles at the same instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SIGHT = 300.0  # [m]; who is farther away is none


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Context of every row, under the names of the drive table; NaN where there is none within `SIGHT`.

    Distances are between vehicle centres along the road [m], never negative; `*_is_truck` is 1 or 0, and 0 where there
    is nobody.
    """

    lead_distance: FloatArray
    lead_is_truck: FloatArray
    left_distance: FloatArray
    left_is_truck: FloatArray
    right_distance: FloatArray
    right_is_truck: FloatArray


def find_neighbours(frame: IntArray, lane: IntArray, s: FloatArray, is_truck: NDArray[np.bool_]) -> Neighbours:
    """Leader in the same lane and nearest vehicle in the lanes beside.

    Parameters
    ----------
    frame : array of int, shape (n,)
        Equal for rows of the same instant (and carriageway).
    lane : array of int, shape (n,)
        0 = rightmost driving lane, counting up to the left; negative: in no lane.
    s : array, shape (n,)
        Along the road, growing in the direction of travel. [m]
    is_truck : array of bool, shape (n,)
    """
    known = lane >= 0
    group = np.where(known, frame * 64 + lane, -1)
    order = np.lexsort((s, group))
    # One sorted axis for all groups: each gets its own, far apart from the next.
    span = float(np.ptp(s)) + 4.0 * SIGHT if len(s) else 1.0
    base = float(s.min()) if len(s) else 0.0
    axis = group[order] * span + (s[order] - base)

    def nearest(target: IntArray, ahead_only: bool) -> tuple[FloatArray, FloatArray]:
        place = target * span + (s - base)
        after = np.searchsorted(axis, place, side="right")
        best, truck = np.full(len(s), np.inf), np.zeros(len(s))
        for candidate in (after,) if ahead_only else (after, after - 1):
            there = (candidate >= 0) & (candidate < len(axis)) & known
            who = order[np.clip(candidate, 0, len(axis) - 1)]
            gap = np.where(there & (group[who] == target), np.abs(s[who] - s), np.inf)
            closer = (gap < best) & (gap <= SIGHT)
            best, truck = np.where(closer, gap, best), np.where(closer, is_truck[who], truck)
        return np.where(np.isfinite(best), best, np.nan), truck

    lead, lead_truck = nearest(group, ahead_only=True)
    left, left_truck = nearest(np.where(known, group + 1, -2), ahead_only=False)
    right, right_truck = nearest(np.where(known & (lane > 0), group - 1, -2), ahead_only=False)
    return Neighbours(lead, lead_truck, left, left_truck, right, right_truck)
