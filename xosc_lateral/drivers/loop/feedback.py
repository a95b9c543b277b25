"""Feedback: columns that the car's own movement brings about are no cause, whatever they correlate with.

Declared road, weather and traffic are never a consequence, and the car's own movement never a cause. All other columns
are tested for three marks.

*Coherence.* A driver responds to a cause as through a low-pass of seconds: above 0.2 Hz an offset shares next to
nothing with its causes. A steering angle or a yaw rate is the movement's own derivative, and shares nearly all.

*Direction of time.* Given its own past, a cause owes nothing to what the car did just before; a column that a system
computes from the offset (a torque that keeps the lane, a filtered copy) is predicted by it [1]_. Both are asked of the
offset, its size, its excess over the usual size, its speed and the size of that.

*Function of the offset.* The column's mean given the present offset is the function that fits it best [2]_.

References
----------
.. [1] C. W. J. Granger, "Investigating causal relations by econometric models and cross-spectral methods",
   Econometrica 37, 1969.
.. [2] L. Breiman, J. Friedman, "Estimating optimal transformations for multiple regression and correlation", J.
   American Statistical Association 80, 1985: the conditional mean is the function that is most correlated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.loop.autocorrelation import positions_in_run
from xosc_lateral.drivers.loop.columns import Assigned, Column, Role, Values
from xosc_lateral.drivers.loop.timeline import Timeline

ComplexArray = NDArray[np.complex128]

# Samples per segment of the spectral estimate: 25.6 s, and 12.8 s where runs are too short for enough of those.
SEGMENTS = (128, 64)
# Edges of the parts of the band where a driver no longer responds, and sensors still see the car move. [Hz]
BAND = (0.2, 0.3, 0.4, 0.6, 0.8)
# Squared coherence from which a column is feedback if the movement predicts it too, and from which it is doubtful if
# not. Causes that change over ten seconds and more stay below 0.06, also where they move the car by 0.9 m; a switch
# that moves a car of little movement of its own by 0.2 m has 0.29, gusts of 3 s that push a car by 0.8 m up to 0.49;
# consequences are above 0.5, and 0.35 where most of the column is something else. [-]
FEEDBACK_COHERENCE, DOUBTFUL_COHERENCE = 0.2, 0.5
# Share of a column's innovations that the movement predicts: from the first on it is feedback, from the second on
# doubtful; below the last, coherence alone is doubtful too. Causes that share more than 0.2 (gusts that push a car by
# 0.8 m) stay below 0.0006; a steering angle or a yaw rate that mostly follows the road's curves has 0.0065. [-]
PREDICTED, DOUBTFUL_SHARE, NEGLIGIBLE_SHARE = 0.05, 0.02, 0.003
# Squared coherence with its own mean given the present offset or lateral speed, from which a column is a function of
# it. Warnings with hysteresis have 0.8, a lateral speed 0.4 to 0.7, causes below 0.06. [-]
FUNCTION = 0.4
# Quantiles of the movement between which that mean is taken: finer at the ends, where warnings fire. [-]
PARTS = np.concatenate([np.array([0.005, 0.01, 0.02]), np.linspace(0.04, 0.96, 24), np.array([0.98, 0.99, 0.995])])
PARTS_S = 150.0  # Stretches of so long are dealt to two halves; the mean of either half is taken from the other. [s]
# Past samples of the column, and of the movement, in the test of time's direction: 2 s and 1 s.
OWN_PAST, MOVED_PAST = 10, 5
# Over the number of segments: what unrelated columns' coherence stays below, the largest of 4 parts and 6 movements
# (with 40 half-overlapping segments they reach 0.14). [-]
CHANCE = 6.0
# Rows per quantity that a regression needs to tell anything (F. Harrell, Regression Modeling Strategies, 2015). [-]
ROWS_EACH = 15
MIN_SEGMENTS = 12  # Fewer segments of one length than this say little: the next length is taken.


@dataclass(frozen=True, slots=True)
class Feedback:
    """A column that the movement itself brings about."""

    column: str
    coherence: float  # Squared, above 0.2 Hz, with what it follows most. [-]
    predicted_share: float  # Share of its innovations that the movement predicts. [-]
    function: float  # Squared coherence, in the same band, with its own mean given the present movement. [-]
    of: str  # What it follows: "offset", "size of the offset", ...
    doubtful: bool  # No mark is clear.
    source: str = ""  # "declared" or "name": it is said to be the car's own movement; empty: its values show it.


def find_feedback(
    timeline: Timeline, columns: Iterable[Column], roles: Mapping[str, Assigned] = MappingProxyType({})
) -> list[Feedback]:
    """Columns that follow from the movement, doubtful ones included."""
    segments, moved = _Segments(timeline.valid), _movement(timeline)
    spectra = {name: segments.spectra(values) for name, values in moved.items()}
    rows = np.flatnonzero(positions_in_run(timeline.valid) >= max(OWN_PAST, MOVED_PAST))
    chance = CHANCE / max(1, segments.number)
    feedback = []
    for column in columns:
        assigned = roles.get(column.name, Assigned(column.name, Role.UNKNOWN, ""))
        if assigned.declared and assigned.role.is_exogenous:
            continue
        values = timeline.context.get(column.name, timeline.lane_width)
        known = np.isfinite(values)
        values = np.where(known, values, np.median(values[timeline.valid & known]))
        seen, size = (segments.spectra(one) for one in (values, np.abs(values - np.median(values[timeline.valid]))))
        shared = {name: segments.coherence(seen, is_movement) for name, is_movement in spectra.items()}
        for name in ("size of the offset", "excess of the offset"):
            shared[name] = max(shared[name], segments.coherence(size, spectra[name]))
        by_function = {
            name: segments.coherence(seen, segments.spectra(_mean_given(values, moved[name], timeline)))
            for name in ("offset", "lateral speed")
        }
        # a switch has hardly any changes that could be predicted
        changes = column.values in (Values.NUMBER, Values.ANGLE)
        predicted = _predicted_share(values, moved, rows) if changes else 0.0
        of, coherence = max(shared.items(), key=lambda pair: pair[1])
        of_function, function = max(by_function.items(), key=lambda pair: pair[1])
        is_function = function >= max(FUNCTION, chance)
        follows = coherence >= max(FEEDBACK_COHERENCE, chance) and predicted >= NEGLIGIBLE_SHARE
        clear = follows or predicted >= PREDICTED
        doubtful = coherence >= max(DOUBTFUL_COHERENCE, chance) or predicted >= DOUBTFUL_SHARE
        if is_function and not clear:
            of = of_function
        if assigned.role.is_exogenous:  # a name alone is overruled where both marks are strong
            clear, doubtful = predicted >= PREDICTED and coherence >= max(DOUBTFUL_COHERENCE, chance), False
        is_movement = assigned.role is Role.OWN
        if is_movement or clear or is_function or doubtful:
            sure, source = is_movement or clear or is_function, assigned.source if is_movement else ""
            feedback.append(Feedback(column.name, coherence, predicted, function, of, not sure, source))
    return feedback


def _mean_given(values: FloatArray, movement: FloatArray, timeline: Timeline) -> FloatArray:
    """Mean of a column given the movement just then, by the other half of the drives; shape (n,), in its unit."""
    part = np.searchsorted(np.unique(np.quantile(movement[timeline.valid], PARTS)), movement)
    half = (np.arange(len(values)) // round(PARTS_S / timeline.step)) % 2
    usual, size = float(values[timeline.valid].mean()), int(part.max()) + 1
    result = np.full(len(values), usual)
    for part_of_two in (0, 1):
        other = timeline.valid & (half != part_of_two)
        count = np.bincount(part[other], minlength=size)
        sums = np.bincount(part[other], values[other], minlength=size)
        result[half == part_of_two] = ((sums + usual) / (count + 1.0))[part[half == part_of_two]]
    return result


def _movement(timeline: Timeline) -> Mapping[str, FloatArray]:
    inside = timeline.valid
    offset = np.where(inside, timeline.offset - np.median(timeline.offset[inside]), 0.0)
    size = np.abs(offset)
    usual = float(np.quantile(size[inside], 0.75))
    speed = np.gradient(offset, timeline.step)
    return {
        "offset": offset,
        "size of the offset": size,
        "excess of the offset": np.sign(offset) * np.maximum(size - usual, 0.0),
        "lateral speed": speed,
        "size of the lateral speed": np.abs(speed),
    }


def _predicted_share(values: FloatArray, moved: Mapping[str, FloatArray], rows: IndexArray) -> float:
    """Partial R squared of the recent movement, the present included, given the column's own past."""
    if len(rows) < ROWS_EACH * (1 + OWN_PAST + len(moved) * len(range(0, MOVED_PAST + 1, 2))):
        return 0.0
    now = values[rows]
    past = [np.ones(len(rows)), *(values[rows - lag] for lag in range(1, OWN_PAST + 1))]
    other = [series[rows - lag] for series in moved.values() for lag in range(0, MOVED_PAST + 1, 2)]
    alone, together = (_left(now, np.stack(design, axis=1)) for design in (past, past + other))
    freedom = len(rows) / max(1, len(rows) - len(past) - len(other))
    return max(0.0, 1.0 - freedom * together / max(alone, 1e-300)) if alone > 1e-12 * float(np.var(now)) else 0.0


def _left(values: FloatArray, design: FloatArray) -> float:
    scaled = design / np.maximum(np.sqrt(np.mean(design**2, axis=0)), 1e-300)
    gram = scaled.T @ scaled
    gram[np.diag_indices(len(gram))] *= 1.0 + 1e-10
    sizes = np.linalg.lstsq(gram, scaled.T @ values, rcond=None)[0]
    return float(np.mean((values - scaled @ sizes) ** 2))


class _Segments:
    """Segments of uninterrupted movement, half overlapping, for spectra: the longest of which there are enough."""

    def __init__(self, valid: BoolArray) -> None:
        sums = np.concatenate([[0], np.cumsum(valid)])
        for length in SEGMENTS:
            starts, at = [], 0
            while at + length <= len(valid):
                inside = sums[at + length] - sums[at] == length
                starts.extend([at] if inside else [])
                at += length // 2 if inside else length // 16
            if len(starts) >= MIN_SEGMENTS:
                break
        self.number = len(starts)
        self._rows = np.asarray(starts, dtype=np.intp)[:, None] + np.arange(length)
        frequency = np.fft.rfftfreq(length, STEP)
        self._in_band = (frequency >= BAND[0]) & (frequency <= BAND[-1])
        self._part = np.searchsorted(BAND[1:-1], frequency[self._in_band], side="right")

    def spectra(self, values: FloatArray) -> ComplexArray:
        """Transforms of the first difference in the band, shape (segments, frequencies)."""
        pieces = np.diff(values, prepend=values[:1])[self._rows] * np.hanning(self._rows.shape[1])
        return np.asarray(np.fft.rfft(pieces, axis=1)[:, self._in_band])

    def coherence(self, first: ComplexArray, second: ComplexArray) -> float:
        """Squared, in the part of the band where most is shared: a shaky sensor hides the faster parts."""
        cross = np.abs(np.sum(first * np.conj(second), axis=0)) ** 2
        power = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(second) ** 2, axis=0)
        coherence = cross / np.maximum(power, 1e-300)
        return float(max(coherence[self._part == index].mean() for index in np.unique(self._part)))
