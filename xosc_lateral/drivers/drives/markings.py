"""Both lane markings as two views of one place in the lane: where a camera misjudges one, the other is followed.

A lane tracker's offset is half the difference of its distances to the two markings, its lane width their sum. When it
takes a kerb, a crack or the next lane's line for a marking, that distance jumps or creeps away by up to a metre, the
offset by half of it, and the lane seems to widen; the other marking goes on as before. A lane hardly changes its width
within seconds and a vehicle can't jump, so the two are separable: offset y and lane width w are smoothed together,

    left = w / 2 - y + error,    right = w / 2 + y + error,

with errors of a Student's t distribution, which lets single views be wrong [1]_, an integrated acceleration in y and a
random walk in w. The smoothing only says how far each view is to be trusted. Rows are then weighted means of what the
two views say, which is the offset as recorded wherever both are as good, and are left out where neither is.

References
----------
.. [1] K. L. Lange, R. J. A. Little, J. M. G. Taylor, "Robust statistical modeling using the t distribution", Journal of
   the American Statistical Association 84, 1989: the weights, and 4 degrees of freedom where few are in doubt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import MAD_TO_SD, BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.drives.drive import MAX_GAP, STEP, MarkingShares, lane_steps

DEGREES = 4.0
"""Of freedom of the views' errors. [-]"""

ACCELERATION = 0.02
"""Density of a driver's lateral acceleration: 0.14 m/s2 rms below 0.5 Hz, as on motorways. [m2/s3]"""

WIDENING = 3e-4
"""Of the lane: 0.02 m within a second, 0.1 m within 40 s (`docs/design/markings.md` shows how little either matters).
[m2/s]"""

CAMERA_NOISE = 0.01
"""A lane width that wavers by less (standard deviation of each marking) comes from a map, not from a camera. [m]"""

LEAST_NOISE = 0.05
"""No camera knows a marking better: its paint is 0.12 to 0.15 m wide, worn, and the vehicle pitches. [m]"""

WAVERS_WITHIN = 51
"""Blocks, 10 s, about whose median a camera's noise is seen. [-]"""

MAXIMUM_ERROR_RATIO = 6.0
"""No noise is so many standard deviations off: a drive without it is left as it is. [-]"""

LEAST_TRUST = 0.15
"""Rows with less in the mean of their two views are left out: both are 5 standard deviations off, and more. [-]"""

MENDED_OFFSET_CHANGE = 0.05
"""Rows whose offset changes by more are counted as mended. [m]"""

ROUNDS, REWEIGHTING_LIMITS = 50, 1e-2
"""Of reweighting: at most, and when no error changes by more. [-]"""

SINGULAR = 1e-9
"""Added to the diagonal: a piece of one row has no slope."""


@dataclass(frozen=True, eq=False, slots=True)
class Mended:
    """Rows with a misjudged marking seen through."""

    offset: FloatArray
    lane_width: FloatArray  # Shape (n,). The lane width smoothed. [m]
    kept: BoolArray  # Shape (n,). Rows with a view to trust.
    shares: MarkingShares


def both_markings(time: FloatArray, offset: FloatArray, lane_width: FloatArray) -> BothMarkings | None:
    """What a camera saw of both lane markings, from rows as recorded at increasing times [s], shape (n,). [m]

    None where the lane width wasn't measured, or not by what measured the offset.
    """
    if np.ptp(lane_width) == 0.0:  # before anything is imported or computed: from a map, as most tables have it
        return None
    from scipy.ndimage import median, median_filter

    breaks = (np.diff(time) > MAX_GAP) | lane_steps(offset, lane_width)
    block, moment = _blocks(time, breaks)
    count = int(block[-1]) + 1
    if count < 3:
        return None
    seen = np.bincount(block, minlength=count) > 0
    left, right = np.zeros(count), np.zeros(count)
    left[seen] = median(0.5 * lane_width - offset, block, np.flatnonzero(seen))
    right[seen] = median(0.5 * lane_width + offset, block, np.flatnonzero(seen))
    width = (left + right)[seen]
    # Where one marking is misjudged, the offset jumps by half as much as the lane width; one from elsewhere never does.
    jumps = np.abs(np.diff(width)) > MAXIMUM_ERROR_RATIO * LEAST_NOISE
    follows = np.abs(np.diff(0.5 * (right - left)[seen])) > 0.5 * MAXIMUM_ERROR_RATIO * LEAST_NOISE
    if jumps.any() and not follows[jumps].any():
        return None
    about = np.abs(width - median_filter(width, size=WAVERS_WITHIN, mode="nearest"))
    noise = MAD_TO_SD * float(np.median(about)) / np.sqrt(2.0)
    if noise < CAMERA_NOISE:
        return None
    borders = block[np.flatnonzero(breaks)]
    return BothMarkings(
        offset, lane_width, moment, left, right, seen, borders, np.diff(time)[breaks], max(noise, LEAST_NOISE)
    )


@dataclass(frozen=True, eq=False, slots=True)
class BothMarkings:
    """What a camera saw of both lane markings: rows, and medians of blocks of `STEP`."""

    offset: FloatArray
    lane_width: FloatArray  # As recorded, shape (n,). [m]
    moment: FloatArray  # Of the rows, see `_blocks`. [s]
    left: FloatArray
    right: FloatArray  # Distances of blocks to both markings. [m]
    seen: BoolArray  # Blocks that have rows.
    breaks: IntArray  # Blocks after which the next is not joined.
    gaps: FloatArray  # Times between the rows on both sides of these. [s]
    noise: float  # Of a marking, standard deviation. [m]

    def mended(self) -> Mended | None:
        """With the other marking followed where one was misjudged; None where nothing is impossible."""
        smoothed = self._smoothed()
        if smoothed is None:
            return None
        centres = STEP * (np.arange(len(self.left)) + 0.5)
        place, lane = (np.interp(self.moment, centres, values) for values in smoothed)
        wider, moved = self.lane_width - lane, self.offset - place
        errors = (0.5 * wider - moved, 0.5 * wider + moved)  # of the rows' views of both markings
        noise = max(MAD_TO_SD * float(np.median(np.abs(np.concatenate(errors)))), CAMERA_NOISE)
        left, right = (_weights(error / noise) for error in errors)
        change = 0.5 * wider * (right - left) / (left + right)
        kept = 0.5 * (left + right) >= LEAST_TRUST
        shares = MarkingShares(float(np.mean(kept & (np.abs(change) > MENDED_OFFSET_CHANGE))), float(np.mean(~kept)))
        return Mended(self.offset + change, lane, kept, shares)

    def _smoothed(self) -> tuple[FloatArray, FloatArray] | None:
        """Offset and lane width of each block [m]; None where no error is impossible."""
        scaled = (np.zeros(len(self.left)), np.zeros(len(self.left)))
        prior = self._prior()
        for _ in range(ROUNDS):
            offset, width = self._most_likely(prior, scaled)
            half_widths = (self.left - 0.5 * width + offset, self.right - 0.5 * width - offset)
            before, scaled = scaled, (self.seen * half_widths[0] / self.noise, self.seen * half_widths[1] / self.noise)
            if (
                max(float(np.abs(new - old).max()) for new, old in zip(scaled, before, strict=True))
                < REWEIGHTING_LIMITS
            ):
                break
        worst = max(float(np.abs(one).max()) for one in scaled)
        return (offset, width) if worst > MAXIMUM_ERROR_RATIO else None

    def _prior(self) -> FloatArray:
        """Lower bands of the prior's precision; unknowns are offset and width of each block in turn, shape (5, 2 n)."""
        count = len(self.left)
        bands = np.zeros((5, 2 * count))
        bands[0] = SINGULAR
        joined = np.ones(count - 2)
        for block in self.breaks:
            joined[max(block - 1, 0) : block + 1] = 0.0
        bend = (1.0, -2.0, 1.0)
        for later in range(3):
            for earlier in range(later + 1):
                at = slice(2 * earlier, 2 * (earlier + count - 2), 2)
                bands[2 * (later - earlier), at] += joined * bend[later] * bend[earlier] / (ACCELERATION * STEP**3)
        steps = np.full(count - 1, STEP)
        steps[self.breaks] = np.maximum(self.gaps, STEP)
        walk = 1.0 / (WIDENING * steps)
        bands[0, 1:-2:2] += walk
        bands[0, 3::2] += walk
        bands[2, 1:-2:2] -= walk
        return bands

    def _most_likely(self, prior: FloatArray, scaled: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Offset and lane width of each block that prior and views make most likely, by the views' last errors. [m]"""
        from scipy.linalg import solveh_banded

        certainty = (DEGREES + 1.0) / DEGREES / self.noise**2
        left, right = (certainty * _weights(one) * self.seen for one in scaled)
        bands = prior.copy()
        bands[0, ::2] += left + right
        bands[0, 1::2] += 0.25 * (left + right)
        bands[1, ::2] += 0.5 * (right - left)
        wanted = np.empty(bands.shape[1])
        wanted[::2] = right * self.right - left * self.left
        wanted[1::2] = 0.5 * (right * self.right + left * self.left)
        widths = solveh_banded(bands, wanted, lower=True)
        return widths[::2], widths[1::2]


def _weights(scaled: FloatArray) -> FloatArray:
    """Of errors in standard deviations, as Student's t distribution has them; 1 for no error. [-]"""
    return DEGREES / (DEGREES + scaled**2)


def _blocks(time: FloatArray, breaks: BoolArray) -> tuple[IntArray, FloatArray]:
    """Number of each row's block, and its moment on a clock on which every break takes as long as a block. [s]"""
    steps = np.where(breaks, STEP, np.diff(time))
    moment = np.concatenate([[0.0], np.cumsum(steps)])
    return (moment / STEP).astype(np.int64), moment
