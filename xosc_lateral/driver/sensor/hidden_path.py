"""Paths that rounded values may hide: drawn given the rows and the driver's spectrum.

Gibbs sampling of two things in turn [1]_: the path given noisy values of it, which is one filter on all frequencies at
once, and these values given the path, each a normal variable confined to the step that its row was rounded from. The
noise between both is the sensor's; where that has (almost) none, it is `LEAST_NOISE` of the step or of the movement,
whichever is smaller: by so much a path may leave its step.

References
----------
.. [1] J. Albert, S. Chib, "Bayesian analysis of binary and polychotomous response data", J. American Statistical
   Association 88, 1993: hidden values confined by what was seen of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.vehicle_bound import density

FloatArray = NDArray[np.float64]

LEAST_NOISE = 0.1
"""Smaller noise would keep paths near to where they begin for more rounds than there are. [-]"""

ROUNDS = 300
"""Of both draws: a path crosses a step in (1 / LEAST_NOISE)^2 of them, and begins as any of the driver's. [-]"""

MARGIN = 60.0
"""Of free movement after the end, so that it doesn't hang on the beginning. [s]"""


@dataclass(frozen=True, eq=False)
class HiddenPath:
    """All that a draw needs.

    Parameters
    ----------
    knots : array
        Of the driver's density, see `vehicle_bound`.
    mean : float
        Of the driver, counted from the lattice. [m]
    phase : float
        Where the lattice lies. [m]
    grain : float
        Its step. [m]
    noise : float
        Variance of the noise before rounding. [m2]
    deviation : float
        Standard deviation before rounding. [m]
    """

    knots: FloatArray
    mean: float
    phase: float
    grain: float
    noise: float
    deviation: float

    def draw(self, offset: FloatArray, step: float) -> FloatArray:
        """A path whose rounded values are those of a run at an even step [s], shape (n,). [m]

        The same for the same run: what is drawn hangs on its levels.
        """
        n = len(offset)
        level = np.round((offset - self.phase) / self.grain)
        rng = np.random.default_rng(crc32(level.astype("<i4").tobytes()))
        middle = self.grain * level - self.mean
        low, high = middle - 0.5 * self.grain, middle + 0.5 * self.grain
        spread = float(np.sqrt(max(self.noise, (LEAST_NOISE * min(self.grain, self.deviation)) ** 2)))
        size = 1 << int(np.ceil(np.log2(n + MARGIN / step)))
        power = density(self.knots, np.asarray(np.fft.rfftfreq(size, step), dtype=np.float64)) / (2.0 * step)
        keep = power / (power + spread**2)
        path = _filtered(rng.normal(size=size), np.sqrt(power))
        for _ in range(ROUNDS):
            seen = path + spread * rng.normal(size=size)
            seen[:n] = path[:n] + spread * _confined((low - path[:n]) / spread, (high - path[:n]) / spread, rng)
            path = _filtered(seen, keep) + _filtered(rng.normal(size=size), spread * np.sqrt(keep))
        return np.asarray(self.phase + self.mean + path[:n])


def _filtered(values: FloatArray, gain: FloatArray) -> FloatArray:
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * gain, len(values)))


def _confined(low: FloatArray, high: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Standard normal variables between two bounds, shape of either; mirrored to where the tail has digits. [-]"""
    from scipy.special import ndtr, ndtri

    mirrored = low > 0.0
    near, far = np.where(mirrored, -high, low), np.where(mirrored, -low, high)
    below, above = ndtr(near), ndtr(far)
    drawn = ndtri(np.clip(below + (above - below) * rng.random(len(low)), 1e-300, 1.0 - 1e-16))
    drawn = np.clip(drawn, near, far)
    return np.asarray(np.where(mirrored, -drawn, drawn))
