"""The band of a recording: how much of fast movement it shows, to see other traffic through it.

Recordings are smoothed on their way into a file; sampled traffic is not. A detector that is set up on the one is too
nervous or too calm for the other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.base.rows import true_slices
from xosc_lateral.drivers.evaluation.spectra import SEGMENTS, Spectrum, spectrum
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack, truth_of

ROWS = round(0.2 / STEP)
"""Rows to one of the spectrum's, whose windows are made for 5 Hz. [rows]"""
LEAST_FREQUENCY = 0.1
"""Slower movement is seen as it is: lane changes of up to 10 s are made of it, and drivers differ in it. [Hz]"""


@dataclass(frozen=True, eq=False)
class SensorBand:
    """Share of the amplitude that is seen at each frequency; shape (n,) each. [Hz], [-]"""

    frequency: FloatArray
    gain: FloatArray

    def at(self, frequency: FloatArray) -> FloatArray:
        """Gain at frequencies, linear over their logarithm, 1 up to `LEAST_FREQUENCY`."""
        floor = np.maximum(frequency, 1e-9)
        inside = np.interp(np.log(floor), np.log(np.r_[LEAST_FREQUENCY, self.frequency]), np.r_[1.0, self.gain])
        return np.where(frequency <= LEAST_FREQUENCY, 1.0, inside)

    def seen(self, position: FloatArray) -> FloatArray:
        """A lateral position every `STEP` as it is seen, without delay; shape (n,). [m]

        Beyond its ends it goes on as its mirror image about its last value, so that an end is no edge.
        """
        n = len(position)
        whole = np.concatenate([2.0 * position[0] - position[:0:-1], position, 2.0 * position[-1] - position[-2::-1]])
        trend = np.linspace(whole[0], whole[-1], len(whole))
        gain = self.at(np.asarray(np.fft.rfftfreq(len(whole), STEP), dtype=np.float64))
        return np.asarray((trend + np.fft.irfft(gain * np.fft.rfft(whole - trend), len(whole)))[n - 1 : 2 * n - 1])


def keeping_spectrum(tracks: Iterable[LaneTrack], source: str) -> Spectrum:
    """Of the offset in lane keeping; raises `NotEnoughDataError` where no stretch is long enough."""
    runs = []
    for track in tracks:
        whole = np.concatenate([[0.0], np.cumsum(track.offset)])
        for rows in true_slices(truth_of(track).keeping):
            edges = np.arange(rows.start, rows.stop + 1, ROWS)  # means of the rows between: no aliases
            if len(edges) > SEGMENTS[-1]:
                runs.append(np.diff(whole[edges]) / ROWS)
    if not runs:
        raise NotEnoughDataError(
            f"{source}: no vehicle keeps its lane for {SEGMENTS[-1] * ROWS * STEP:.0f} s, for its band"
        )
    return spectrum(runs, ROWS * STEP)


def band_of(recorded: Spectrum, home: Spectrum) -> SensorBand:
    """What a recording shows of movement like home's: the root of the ratio of both spectra, at most 1."""
    there, here = np.round(recorded.frequency, 5), np.round(home.frequency, 5)  # as a record holds them
    rows = np.isin(there, here) & (recorded.frequency > LEAST_FREQUENCY)
    frequency, density = recorded.frequency[rows], home.density[np.isin(here, there[rows])]
    with np.errstate(divide="ignore"):
        gain = np.sqrt(recorded.density[rows] / density)
    return SensorBand(frequency, np.minimum(np.nan_to_num(gain, nan=1.0), 1.0))


RECORDED_SPECTRUM = "recorded_spectrum"
"""Key of a profile's record: the spectrum of its recording."""


def spectrum_in(profile: DriverProfile) -> Spectrum:
    """Of lane keeping in a profile's recording, from its record; `DriverProfileError`: that holds none."""
    known: Any = profile.provenance.fit.get(RECORDED_SPECTRUM)
    try:
        frequency, density = (np.array(known[name], dtype=np.float64) for name in ("frequency_hz", "m2_per_hz"))
        if frequency[0] > 0.0 and (np.diff(frequency) > 0.0).all() and (density[: len(frequency)] >= 0.0).all():
            return Spectrum(frequency, np.broadcast_to(density, frequency.shape), np.zeros(len(frequency), np.int64))
    except (IndexError, KeyError, TypeError, ValueError):  # anybody may write there what they like
        pass
    raise DriverProfileError(f"{profile.name} does not hold the spectrum of its recording: name the recording")
