"""Columns that follow from the car's own movement: no cause, whatever they correlate with.

A driver answers to a cause within seconds, as through a low-pass, and most of what he does has nothing to do with any
one cause: above 0.2 Hz an offset shares next to nothing with its causes. A steering angle or a yaw rate is the
movement's own derivative: there it shares nearly all. So the squared coherence between 0.2 and 0.8 Hz tells them
apart, in the part of that band where it is highest: a shaky camera hides the faster ones (measured on simulated drives:
causes below 0.06 even where they move the car by half a metre, consequences above 0.5, above 0.7 with a good camera).
Curvature, the one thing that turns wheel and car without moving the car in its lane, is taken out of both first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.columns import Column, Role
from xosc_lateral.loop.timeline import Timeline

FloatArray = NDArray[np.float64]

SEGMENT = 128
"""Samples per segment of the spectral estimate: 25.6 s."""

BAND = (0.2, 0.8)
"""Where a driver no longer answers, and sensors still see the car move. [Hz]"""

PARTS = (0.2, 0.3, 0.4, 0.6, 0.8)
"""Edges of the parts of the band. [Hz]"""

LIMIT = 0.2
"""Squared coherence from which a column counts as a consequence. [-]"""

MIN_SEGMENTS = 12
"""Fewer segments than this say nothing."""


@dataclass(frozen=True, slots=True)
class Consequence:
    """A column that the movement itself brings about.

    Parameters
    ----------
    column : str
    coherence : float
        Squared coherence with the offset or its size, between 0.2 and 0.8 Hz. [-]
    of : str
        What it follows: "offset" or "size of the offset".
    """

    column: str
    coherence: float
    of: str

    @property
    def why(self) -> str:
        """One sentence for the report."""
        return (
            f"at {BAND[0]:g} to {BAND[1]:g} Hz, too fast for a driver's answer, it shares "
            f"{100 * self.coherence:.0f} % of its variance with the {self.of}: it follows from the car's own movement"
        )


def find_consequences(timeline: Timeline, columns: Iterable[Column]) -> list[Consequence]:
    """Columns among `columns` whose fast part goes with the fast part of the offset."""
    starts = _segments(timeline)
    if len(starts) < MIN_SEGMENTS:
        return []
    offset = _spectra(timeline.offset, starts)
    centred = np.abs(timeline.offset - np.median(timeline.offset[timeline.valid]))
    size = _spectra(centred, starts)
    common = _common_cause(timeline, starts)
    found = []
    for column in columns:
        if column.role not in (Role.NUMBER, Role.SWITCH, Role.LEVELS) or column.name in ("curvature", "lane_index"):
            continue
        values = timeline.context.get(column.name, timeline.lane_width)
        own = _without(_spectra(np.nan_to_num(values, nan=float(np.nanmedian(values))), starts), common)
        shared = {"offset": _coherence(own, offset), "size of the offset": _coherence(own, size)}
        of = max(shared, key=lambda name: shared[name])
        if shared[of] >= max(LIMIT, 6.0 / len(starts)):
            found.append(Consequence(column.name, shared[of], of))
    return found


def _segments(timeline: Timeline) -> NDArray[np.intp]:
    starts, at, n = [], 0, len(timeline)
    sums = np.concatenate([[0], np.cumsum(timeline.valid)])
    while at + SEGMENT <= n:
        if sums[at + SEGMENT] - sums[at] == SEGMENT:
            starts.append(at)
            at += SEGMENT // 2
        else:
            at += SEGMENT // 16
    return np.asarray(starts, dtype=np.intp)


def _spectra(values: FloatArray, starts: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Transforms of the first difference in the band, shape (segments, frequencies)."""
    change = np.diff(values, prepend=values[:1])
    pieces = change[starts[:, None] + np.arange(SEGMENT)] * np.hanning(SEGMENT)
    frequency = np.fft.rfftfreq(SEGMENT, 0.2)
    return np.asarray(np.fft.rfft(pieces, axis=1)[:, (frequency >= BAND[0]) & (frequency <= BAND[1])])


def _common_cause(timeline: Timeline, starts: NDArray[np.intp]) -> NDArray[np.complex128] | None:
    curvature = timeline.context.get("curvature")
    if curvature is None:
        return None
    speed = timeline.context.get("speed")
    turning = np.nan_to_num(curvature) * (1.0 if speed is None else np.nan_to_num(speed))
    return _spectra(turning, starts)


def _without(own: NDArray[np.complex128], common: NDArray[np.complex128] | None) -> NDArray[np.complex128]:
    """Take out what goes with the common cause, frequency by frequency."""
    if common is None:
        return own
    power = np.sum(np.abs(common) ** 2, axis=0)
    transfer = np.sum(own * np.conj(common), axis=0) / np.maximum(power, 1e-300)
    return np.asarray(own - transfer * common)


def _coherence(first: NDArray[np.complex128], second: NDArray[np.complex128]) -> float:
    cross = np.abs(np.sum(first * np.conj(second), axis=0)) ** 2
    power = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(second) ** 2, axis=0)
    coherence = cross / np.maximum(power, 1e-300)
    frequency = np.fft.rfftfreq(SEGMENT, 0.2)
    part = np.searchsorted(PARTS[1:-1], frequency[(frequency >= BAND[0]) & (frequency <= BAND[1])], side="right")
    return float(max(coherence[part == index].mean() for index in np.unique(part)))
