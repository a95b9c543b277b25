"""Fine movement of the paper's model: uniform white noise shaped by a kernel, phi = R * k.

Reference: N. Neis, J. Beyerer, arXiv:2405.17080, section III. The amplitude spectrum of the measured fine part,
relative to that of the noise, is approximated by a piecewise linear real-valued damping function over frequency; its
inverse transform is the kernel. Amplitudes are root mean squares over windows, so that the shaped noise has the
variance measured.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
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
