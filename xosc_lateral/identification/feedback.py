"""Feedback: columns that the car's own movement brings about are no cause, whatever they correlate with.

Two marks, either of them enough.

*Coherence.* A driver responds to a cause within seconds, as through a low-pass: above 0.2 Hz an offset shares next to
nothing with its causes. A steering angle or a yaw rate is the movement's own derivative, and shares nearly all.

*Direction of time.* Given its own past, a cause owes nothing to what the car did just before; a column that a system
computes from the offset (a torque that keeps the lane, a filtered copy) is predicted by it [1]_.

Both are asked of the offset, its size, how far it is beyond its usual size, its speed and the size of that: what
follows may follow in any of these ways. They are asked of every column: one that is computed from the offset jumps
across its range at each lane change, and looks like an angle.

References
----------
.. [1] C. W. J. Granger, "Investigating causal relations by econometric models and cross-spectral methods",
   Econometrica 37, 1969.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.columns import Column, Role
from xosc_lateral.identification.timeline import Timeline

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]
ComplexArray = NDArray[np.complex128]

SEGMENTS = (128, 64)
"""Samples per segment of the spectral estimate: 25.6 s, and 12.8 s where runs are too short for enough of those."""

BAND = (0.2, 0.3, 0.4, 0.6, 0.8)
"""Edges of the parts of the band where a driver no longer responds, and sensors still see the car move. [Hz]"""

CLEAR, ALONE = 0.2, 0.5
"""Squared coherence from which a column is feedback if the movement foretells it too, and from which it is doubtful if
not. Causes that change over ten seconds and more stay below 0.06, also where they move the car by 0.9 m; a switch that
moves a car of little movement of its own by 0.2 m has 0.29, gusts of 3 s that push a car by 0.8 m up to 0.49;
consequences are above 0.5, and 0.35 where most of the column is something else. [-]"""

PREDICTED, PERHAPS, HARDLY = 0.05, 0.02, 0.003
"""Share of a column's innovations that the movement foretells: from the first on it is feedback, from the second on
doubtful; below the last, coherence alone is doubtful too. Causes that share more than 0.2 (gusts that push a car by
0.8 m) stay below 0.0006; a steering angle or a yaw rate that mostly follows the road's curves has 0.0065. [-]"""

OWN_PAST, MOVED_PAST = 10, 5
"""Past samples of the column, and of the movement, in the test of time's direction: 2 s and 1 s."""

CHANCE = 6.0
"""Over the number of segments: what unrelated columns' coherence stays below, the largest of 4 parts and 6 movements
(with 40 half-overlapping segments they reach 0.14). [-]"""

ROWS_EACH = 15
"""Rows per quantity that a regression needs to tell anything (F. Harrell, Regression Modeling Strategies, 2015). [-]"""

MIN_SEGMENTS = 12
"""Fewer segments of one length than this say little: the next length is taken."""


@dataclass(frozen=True, slots=True)
class Feedback:
    """A column that the movement itself brings about.

    Parameters
    ----------
    column : str
    coherence : float
        Squared, above 0.2 Hz, with what it follows most. [-]
    predicted_share : float
        Share of its innovations that the movement foretells. [-]
    of : str
        What it follows: "offset", "size of the offset", ...
    doubtful : bool
        Neither mark is clear.
    """

    column: str
    coherence: float
    predicted_share: float
    of: str
    doubtful: bool


def find_feedback(timeline: Timeline, columns: Iterable[Column]) -> list[Feedback]:
    """Columns that follow from the movement, doubtful ones included."""
    segments = _segments(timeline.valid)
    moved = _movement(timeline)
    spectra = {name: segments.spectra(values) for name, values in moved.items()}
    rows = _rows_with_past(timeline.valid, max(OWN_PAST, MOVED_PAST))
    floor = CHANCE / max(1, len(segments.starts))
    found = []
    for column in columns:
        values = timeline.context.get(column.name, timeline.lane_width)
        known = np.isfinite(values)
        values = np.where(known, values, np.median(values[timeline.valid & known]))
        seen = segments.spectra(values)
        shared = {name: segments.coherence(seen, own) for name, own in spectra.items()}
        size = segments.spectra(np.abs(values - np.median(values[timeline.valid])))
        for name in ("size of the offset", "excess of the offset"):
            shared[name] = max(shared[name], segments.coherence(size, spectra[name]))
        of = max(shared, key=lambda name: shared[name])
        # a switch has hardly any changes that could be predicted
        changes = column.role in (Role.NUMBER, Role.ANGLE)
        predicted_share = _predicted_share(values, moved, rows) if changes else 0.0
        clear = predicted_share >= PREDICTED or (shared[of] >= max(CLEAR, floor) and predicted_share >= HARDLY)
        if clear or shared[of] >= max(ALONE, floor) or predicted_share >= PERHAPS:
            found.append(Feedback(column.name, shared[of], predicted_share, of, not clear))
    return found


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


def _predicted_share(values: FloatArray, moved: Mapping[str, FloatArray], rows: IntArray) -> float:
    """Partial R squared of the recent movement, the present included, given the column's own past."""
    if len(rows) < ROWS_EACH * (1 + OWN_PAST + len(moved) * len(range(0, MOVED_PAST + 1, 2))):
        return 0.0
    now = values[rows]
    own = [np.ones(len(rows)), *(values[rows - lag] for lag in range(1, OWN_PAST + 1))]
    other = [series[rows - lag] for series in moved.values() for lag in range(0, MOVED_PAST + 1, 2)]
    alone, together = (_left(now, np.stack(design, axis=1)) for design in (own, own + other))
    freedom = len(rows) / max(1, len(rows) - len(own) - len(other))
    return max(0.0, 1.0 - freedom * together / max(alone, 1e-300)) if alone > 1e-12 * float(np.var(now)) else 0.0


def _left(values: FloatArray, design: FloatArray) -> float:
    scaled = design / np.maximum(np.sqrt(np.mean(design**2, axis=0)), 1e-300)
    gram = scaled.T @ scaled
    gram[np.diag_indices(len(gram))] *= 1.0 + 1e-10
    sizes = np.linalg.lstsq(gram, scaled.T @ values, rcond=None)[0]
    return float(np.mean((values - scaled @ sizes) ** 2))


def _rows_with_past(valid: BoolArray, past: int) -> IntArray:
    sums = np.concatenate([[0], np.cumsum(valid)])
    rows = np.arange(past, len(valid))
    return np.asarray(rows[sums[rows + 1] - sums[rows - past] == past + 1], dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class _Segments:
    """Where the segments of a spectral estimate begin, and how many samples each has."""

    starts: IntArray
    length: int

    def spectra(self, values: FloatArray) -> ComplexArray:
        """Transforms of the first difference in the band, shape (segments, frequencies)."""
        change = np.diff(values, prepend=values[:1])
        pieces = change[self.starts[:, None] + np.arange(self.length)] * np.hanning(self.length)
        return np.asarray(np.fft.rfft(pieces, axis=1)[:, self._in_band(self._frequency())])

    def coherence(self, first: ComplexArray, second: ComplexArray) -> float:
        """Squared, in the part of the band where most is shared: a shaky sensor hides the faster parts."""
        cross = np.abs(np.sum(first * np.conj(second), axis=0)) ** 2
        power = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(second) ** 2, axis=0)
        coherence = cross / np.maximum(power, 1e-300)
        frequency = self._frequency()
        part = np.searchsorted(BAND[1:-1], frequency[self._in_band(frequency)], side="right")
        return float(max(coherence[part == index].mean() for index in np.unique(part)))

    def _frequency(self) -> FloatArray:
        return np.asarray(np.fft.rfftfreq(self.length, 0.2), dtype=np.float64)

    @staticmethod
    def _in_band(frequency: FloatArray) -> BoolArray:
        return np.asarray((frequency >= BAND[0]) & (frequency <= BAND[-1]))


def _segments(valid: BoolArray) -> _Segments:
    """The longest of which there are enough, half overlapping, in uninterrupted stretches."""
    sums = np.concatenate([[0], np.cumsum(valid)])
    for length in SEGMENTS:
        starts, at = [], 0
        while at + length <= len(valid):
            inside = sums[at + length] - sums[at] == length
            starts.extend([at] if inside else [])
            at += length // 2 if inside else length // 16
        if len(starts) >= MIN_SEGMENTS:
            break
    return _Segments(np.asarray(starts, dtype=np.intp), length)
