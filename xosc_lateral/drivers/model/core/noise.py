"""Fine movement of the paper's model: uniform white noise shaped by a kernel, phi = R * k.

Reference: N. Neis, J. Beyerer, arXiv:2405.17080, section III. The amplitude spectrum of the measured fine part,
relative to that of the noise, is approximated by a piecewise linear real-valued damping function over frequency; its
inverse transform is the kernel. Amplitudes are root mean squares over windows, so that the shaped noise has the
variance measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.filters import periodograms
from xosc_lateral.drivers.model.records import Record, frozen_array, set_once

N_KNOTS = 11
"""Knots of the damping function, evenly from 0 to half the sampling rate. [-]"""

KERNEL_TAPS = 51
"""Taps of the kernel (odd): 10 s at 5 Hz, one snippet. [-]"""


class ShapedNoise(Record, frozen=True, eq=False, dict=True):
    """Noise with a damping function.

    Raises `DriverProfileError` if a damping is negative or not finite, or the kernel's length even.
    """

    # At frequencies evenly spaced from 0 to half the sampling rate, shape (n_knots,); >= 0. [lane widths]
    damping: FloatArray
    n_taps: int = KERNEL_TAPS  # Length of the kernel, odd.
    taper: float = 0.0  # Shape of the Kaiser window that the kernel is faded out by; 0: cut off, as in the paper. [-]

    def __post_init__(self) -> None:
        damping = frozen_array(self.damping)
        if damping.ndim != 1 or len(damping) < 2 or not np.isfinite(damping).all() or damping.min() < 0:
            raise DriverProfileError(f"fine noise: damping {damping.tolist()}, expected two or more values >= 0")
        if self.n_taps < 1 or self.n_taps % 2 == 0:
            raise DriverProfileError(f"fine noise: kernel of {self.n_taps} taps, expected an odd number")
        set_once(self, damping=damping)

    @cached_property
    def kernel(self) -> FloatArray:
        """Inverse transform of the damping: real, symmetric about its middle, shape (n_taps,). [lane widths]"""
        frequency = np.arange(self.n_taps // 2 + 1) * 2.0 / self.n_taps  # in units of half the sampling rate
        damping = np.interp(frequency, np.linspace(0.0, 1.0, len(self.damping)), self.damping)
        kernel = np.roll(np.fft.irfft(damping, self.n_taps), self.n_taps // 2)
        return np.asarray(kernel * np.kaiser(self.n_taps, self.taper))


NOISE_VARIANCE = 1.0 / 12.0
"""Of uniform noise in [-0.5, 0.5). [-]"""


def fit_shaped_noise(
    fine_parts: Sequence[FloatArray], *, n_knots: int = N_KNOTS, n_taps: int = KERNEL_TAPS
) -> ShapedNoise:
    """Fit the damping function to measured fine parts [lane widths], one array of shape (n_i,) per run.

    Raises `NotEnoughDataError` when no run holds a window of 5 s.
    """
    lengths = [len(part) for part in fine_parts]
    longest = max(lengths, default=0)
    window = min(n_taps - 1, longest)
    if window < n_taps // 2:
        raise NotEnoughDataError(f"the longest fine part has {longest} values, {n_taps // 2} are needed")
    power = mean_power(fine_parts, window)
    hats = _hats(np.linspace(0.0, 1.0, len(power)), n_knots)
    damping = np.linalg.lstsq(hats, np.sqrt(power / NOISE_VARIANCE), rcond=None)[0]
    return ShapedNoise(np.maximum(damping, 0.0), n_taps)


def mean_power(parts: Sequence[FloatArray], window: int) -> FloatArray:
    """Mean power per frequency over half-overlapping Hann windows, shape (window // 2 + 1,). [square of the unit]

    White noise of variance 1 gives 1 everywhere.
    """
    total, count = np.zeros(window // 2 + 1), 0
    for part in parts:
        powers = periodograms(part, window)
        total += powers.sum(axis=0)
        count += len(powers)
    return total / max(count, 1)


def _hats(at: FloatArray, n_knots: int) -> FloatArray:
    """Piecewise linear basis over [0, 1], shape (len(at), n_knots)."""
    return np.maximum(0.0, 1.0 - np.abs(at[:, None] * (n_knots - 1) - np.arange(n_knots)[None, :]))
