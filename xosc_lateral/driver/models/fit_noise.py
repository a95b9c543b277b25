"""The damping function of the paper's fine movement, from the measured one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.noise import KERNEL_TAPS, N_KNOTS, ShapedNoise
from xosc_lateral.drives.periodogram import periodograms
from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]

NOISE_VARIANCE = 1.0 / 12.0
"""Of uniform noise in [-0.5, 0.5). [-]"""


def fit_shaped_noise(
    fine_parts: Sequence[FloatArray], *, n_knots: int = N_KNOTS, n_taps: int = KERNEL_TAPS
) -> ShapedNoise:
    """Fit the damping function to measured fine parts [lane widths], one array of shape (n_i,) per run.

    Reference: arXiv:2405.17080, section III.

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
    """Mean power per frequency over half-overlapping Hann windows; white noise of variance 1 gives 1 everywhere.

    Returns
    -------
    array, shape (window // 2 + 1,)
        [square of the parts' unit]
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
