"""Fine movement of the paper's model: uniform white noise shaped by a kernel, phi = R * k.

Reference: N. Neis, J. Beyerer, arXiv:2405.17080, section III. The amplitude spectrum of the measured fine part,
relative to that of the noise, is approximated by a piecewise linear real-valued damping function over frequency; its
inverse transform is the kernel. Amplitudes are root mean squares over windows, so that the shaped noise has the
variance measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.compiled import Loop, worth_compiling
from xosc_lateral.errors import DriverProfileError, NotEnoughDataError

FloatArray = NDArray[np.float64]

N_KNOTS = 11
"""Knots of the damping function, evenly from 0 to half the sampling rate. [-]"""

KERNEL_TAPS = 51
"""Taps of the kernel (odd): 10 s at 5 Hz, one snippet. [-]"""

NOISE_VARIANCE = 1.0 / 12.0
"""Of uniform noise in [-0.5, 0.5). [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class ShapedNoise:
    """Noise with a damping function.

    Parameters
    ----------
    damping : array, shape (n_knots,)
        Damping at frequencies evenly spaced from 0 to half the sampling rate; >= 0. [lane widths]
    n_taps : int
        Length of the kernel, odd.
    taper : float
        Shape of the Kaiser window that the kernel is faded out by; 0: cut off, as in the paper. [-]

    Raises
    ------
    DriverProfileError
        If a damping is negative or not finite, or the kernel's length even.
    """

    damping: FloatArray
    n_taps: int = KERNEL_TAPS
    taper: float = 0.0

    def __post_init__(self) -> None:
        """Check, copy and freeze."""
        damping = np.array(self.damping, dtype=np.float64)
        if damping.ndim != 1 or len(damping) < 2 or not np.isfinite(damping).all() or damping.min() < 0:
            raise DriverProfileError(f"fine noise: damping {damping.tolist()}, expected two or more values >= 0")
        if self.n_taps < 1 or self.n_taps % 2 == 0:
            raise DriverProfileError(f"fine noise: kernel of {self.n_taps} taps, expected an odd number")
        damping.flags.writeable = False
        object.__setattr__(self, "damping", damping)

    @property
    def kernel(self) -> FloatArray:
        """Inverse transform of the damping function: real, symmetric about its middle, shape (n_taps,)."""
        frequency = np.arange(self.n_taps // 2 + 1) * 2.0 / self.n_taps  # in units of half the sampling rate
        damping = np.interp(frequency, np.linspace(0.0, 1.0, len(self.damping)), self.damping)
        kernel = np.roll(np.fft.irfft(damping, self.n_taps), self.n_taps // 2)
        return np.asarray(kernel * np.kaiser(self.n_taps, self.taper))


def fit_shaped_noise(
    fine_parts: Sequence[FloatArray], *, n_knots: int = N_KNOTS, n_taps: int = KERNEL_TAPS
) -> ShapedNoise:
    """Fit the damping function to measured fine parts, one array per run. [-]

    Raises
    ------
    NotEnoughDataError
        When no run holds a window of 5 s.
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
    """Mean power per frequency over half-overlapping Hann windows; white noise of variance 1 gives 1 everywhere.

    Returns
    -------
    array, shape (window // 2 + 1,)
    """
    taper = np.hanning(window + 2)[1:-1]
    taper /= np.sqrt((taper**2).sum())
    total, count = np.zeros(window // 2 + 1), 0
    for part in parts:
        if len(part) < window:
            continue
        pieces = np.lib.stride_tricks.sliding_window_view(part, window)[:: max(1, window // 2)]
        total += (np.abs(np.fft.rfft(pieces * taper, axis=1)) ** 2).sum(axis=0)
        count += len(pieces)
    return total / max(count, 1)


def _hats(at: FloatArray, n_knots: int) -> FloatArray:
    """Piecewise linear basis over [0, 1], shape (len(at), n_knots)."""
    return np.maximum(0.0, 1.0 - np.abs(at[:, None] * (n_knots - 1) - np.arange(n_knots)[None, :]))


def _convolve_body(values, kernel, result):  # type: ignore[no-untyped-def]
    taps = len(kernel)
    half = taps // 2
    block = 512  # stays in the first-level cache through all taps
    for first in range(0, len(result), block):
        last = min(first + block, len(result))
        out = result[first:last]
        middle = values[first + half : last + half]
        for i in range(last - first):
            out[i] = kernel[half] * middle[i]
        k = 0
        while k + 4 <= half:  # four taps a pass spare three quarters of the stores
            w0, w1, w2, w3 = kernel[k], kernel[k + 1], kernel[k + 2], kernel[k + 3]
            before = values[first + k : last + k + 3]
            behind = values[first + taps - 4 - k : last + taps - 1 - k]
            for i in range(last - first):  # slices, so that the compiler sees plain indices and vectorises
                total = out[i] + w0 * (before[i] + behind[i + 3])
                total += w1 * (before[i + 1] + behind[i + 2])
                total += w2 * (before[i + 2] + behind[i + 1])
                out[i] = total + w3 * (before[i + 3] + behind[i])
            k += 4
        while k < half:
            weight = kernel[k]
            before = values[first + k : last + k]
            behind = values[first + taps - 1 - k : last + taps - 1 - k]
            for i in range(last - first):
                out[i] += weight * (before[i] + behind[i])
            k += 1


_convolve_compiled = Loop(_convolve_body).compiled


def convolve(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """Values seen through a symmetric kernel of odd length, shape (len(values) - len(kernel) + 1,).

    Every result is the same sum in the same order, however the values are cut into pieces.
    """
    n = len(values) - len(kernel) + 1
    if worth_compiling(n):
        result = np.empty(n)
        _convolve_compiled()(values, kernel, result)
        return result
    half = len(kernel) // 2
    result = kernel[half] * values[half : half + n]
    for k in range(half):
        result += kernel[k] * (values[k : k + n] + values[len(kernel) - 1 - k :][:n])
    return np.asarray(result)
