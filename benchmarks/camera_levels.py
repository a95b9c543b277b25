"""How loud the motorway recording is at each place, band by band, and drives that are as loud there."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from benchmarks.dlr_stretches import Recording
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

EDGES = (0.1, 0.2, 0.3, 0.4)
"""Bands between these, the last without an end. [Hz]"""

TAPS = 41
"""Of the filters between them. [-]"""

PIECE, ROWS = 100.0, 8
"""Length of a place [m], and least rows of a passage: 1.6 s, at 30 m/s half of it. [-]"""

FAINTEST = 1e-12  # [m2]


@dataclass(frozen=True)
class CameraLevels:
    """Log power of each band at each place, above that of other paths. [-]

    Parameters
    ----------
    places : mapping of str to (array, array, bool)
        Times [s] and places along the road [m] of each vehicle, and whether it goes north.
    levels : sequence of mapping of int to float
        One mapping for each band, by place and carriageway.
    """

    places: Mapping[str, tuple[FloatArray, FloatArray, bool]]
    levels: Sequence[Mapping[int, float]]

    @classmethod
    def found(cls, source: Path, runs: Sequence[Run], others: Sequence[FloatArray]) -> CameraLevels:
        """How much louder runs of the recording are at each place than other paths, shape (n_i,) each [m], are there.

        The mean over all places is left to the driver. A place's level is shrunk by the scatter of its passages.
        """
        recording = Recording.read(source)
        rows = recording.table.groupby("drive").indices
        time = recording.table["time"].to_numpy()
        places = {str(name): (time[at], recording.place[at], bool(recording.north[at[0]])) for name, at in rows.items()}
        bare = cls(places, [])
        real, made = bare._passages(runs, [run.offset for run in runs]), bare._passages(runs, others)
        return cls(places, [_shrunk(own, other) for own, other in zip(real, made, strict=True)])

    def on(self, run: Run, path: FloatArray) -> FloatArray:
        """A path of a run, as loud at each place as the recording. [m]"""
        slow, bands = _bands(path)
        pieces = self._pieces(run)
        gains = [np.exp(0.5 * np.array([level.get(piece, 0.0) for piece in pieces.tolist()])) for level in self.levels]
        return slow + sum((band * gain for band, gain in zip(bands, gains, strict=True)), np.zeros(len(path)))

    def _pieces(self, run: Run) -> IntArray:
        time, place, north = self.places[run.drive]
        return (np.interp(run.time, time, place) // PIECE).astype(np.int64) * 2 + north

    def _passages(self, runs: Sequence[Run], paths: Sequence[FloatArray]) -> list[dict[int, list[float]]]:
        """Log powers of all passages by place, for each band."""
        found: list[dict[int, list[float]]] = [defaultdict(list) for _ in EDGES]
        for run, path in zip(runs, paths, strict=True):
            pieces = self._pieces(run)
            for band, passages in zip(_bands(path)[1], found, strict=True):
                for piece, power in _powers(band, pieces):
                    passages[piece].append(power)
        return found


def _powers(band: FloatArray, pieces: IntArray) -> Iterator[tuple[int, float]]:
    for piece in np.unique(pieces).tolist():
        there = pieces == piece
        if there.sum() >= ROWS:
            yield piece, float(np.log((band[there] ** 2).mean() + FAINTEST))


def _bands(path: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """What is below all bands, and each band; their sum is the path. [m]"""
    rest, bands = np.asarray(path, dtype=np.float64), []
    half = min(TAPS, len(rest) - 1) // 2
    for edge in reversed(EDGES):
        kernel = firwin(2 * half + 1, edge, fs=1.0 / STEP)
        slow = np.convolve(np.pad(rest, half, mode="reflect", reflect_type="odd"), kernel, mode="valid")
        bands.append(rest - slow)
        rest = slow
    return rest, bands[::-1]


def _shrunk(real: Mapping[int, list[float]], made: Mapping[int, list[float]]) -> dict[int, float]:
    """Level of each place above the mean of all, by empirical Bayes. [-]"""
    above = {piece: float(np.mean(powers) - np.mean(made[piece])) for piece, powers in real.items()}
    counts = np.array([len(real[piece]) for piece in above])
    values = np.array(list(above.values()))
    values -= np.average(values, weights=counts)
    scatter = np.mean([np.var(powers, ddof=1) for powers in real.values() if len(powers) > 1])
    scatter += np.mean([np.var(powers, ddof=1) for powers in made.values() if len(powers) > 1])
    between = max(float(np.average(values**2 - scatter / counts, weights=counts)), 0.0)
    return dict(zip(above, (values * between / (between + scatter / counts)).tolist(), strict=True))
