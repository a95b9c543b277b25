"""Spectrum of the autoregressive model: the coarse movement's scale, and fine noise that has what it lacks.

References
----------
.. [1] G. Wahba, "Automatic smoothing of the log periodogram", J. American Statistical Association 75, 1980.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.autoregression import Autoregression
from xosc_lateral.driver.models.autoregressive.filters import COARSE_EVERY, building_low_pass
from xosc_lateral.driver.models.autoregressive.parameters import FitSettings
from xosc_lateral.driver.models.noise import NOISE_VARIANCE, ShapedNoise
from xosc_lateral.drives.periodogram import Detrend, periodograms

FloatArray = NDArray[np.float64]

ENOUGH_WINDOWS = 20
"""Spectral windows that a length needs: the log power of one has a standard deviation of 5.6 dB, of so many 1.3 dB."""

MOST_TIME = 0.5
"""Share of all time that they need to hold: a few long runs don't speak for many short ones. The motorway recording's
windows of 30 s hold 0.57, those of 20 s 0.71. [-]"""

GAIN_ROUNDS = 20
"""Rounds in which the damping is corrected for what the kernel's window does to it. [-]"""


def fit_spectrum(
    runs: Sequence[FloatArray], coarse: Autoregression, settings: FitSettings
) -> tuple[Autoregression, ShapedNoise]:
    """Scale of the coarse movement, and fine noise that has what the coarse lacks of the measured power.

    From runs of shape (n_i,), evenly sampled. [lane widths]
    """
    frequency, power = _typical_power(runs, settings)
    knots = np.linspace(0.0, 0.5, settings.n_knots)  # in cycles per sample
    coarse_power = _coarse_power(coarse, knots)
    measured = np.exp(np.interp(knots, frequency, np.log(power)))
    hertz = knots / settings.step
    shared = (hertz >= settings.scale_band[0]) & (hertz <= settings.scale_band[1])
    scale = float(np.exp(np.log(measured[shared] / coarse_power[shared]).mean()))
    lacking = np.maximum(measured - scale * coarse_power, 0.0)
    noise = _shaped(np.sqrt(lacking / NOISE_VARIANCE) * rise(hertz, settings), settings)
    return replace(coarse, scale=coarse.scale * np.sqrt(scale)), noise


def _coarse_power(coarse: Autoregression, knots: FloatArray) -> FloatArray:
    """Of the coarse movement at 5 Hz, shape of `knots` [cycles per sample]. [lane widths squared]"""
    kernel = building_low_pass()
    gain = np.abs(np.exp(-2j * np.pi * np.outer(knots, np.arange(len(kernel)))) @ kernel)
    return np.asarray(coarse.power(knots * COARSE_EVERY) * gain**2 / COARSE_EVERY)


def rise(hertz: FloatArray, settings: FitSettings) -> FloatArray:
    """From 0 to 1 where the fine noise begins, shape of `hertz` [Hz]. [-]"""
    low, high = settings.fine_from
    return np.asarray(np.sin(0.5 * np.pi * np.clip((hertz - low) / (high - low), 0.0, 1.0)) ** 2)


def window_of(runs: Sequence[FloatArray], lengths: Sequence[float], settings: FitSettings) -> int:
    """Samples of the first of some lengths [s] that enough windows are as long as; of the last where none is."""
    sizes = [round(seconds / settings.step) for seconds in lengths]
    least = MOST_TIME * sum(map(len, runs))
    for size in sizes:
        count = sum(len(run) // size for run in runs)
        if count >= ENOUGH_WINDOWS and count * size >= least:
            return size
    return sizes[-1]


def _shaped(wanted: FloatArray, settings: FitSettings) -> ShapedNoise:
    """Noise whose kernel has the wanted gain at the knots, although it is short and faded out."""
    half = settings.n_taps // 2
    knots = np.linspace(0.0, 0.5, len(wanted))
    waves = np.cos(2.0 * np.pi * np.outer(knots, np.arange(-half, half + 1)))
    noise = ShapedNoise(wanted, settings.n_taps, settings.taper)
    for _ in range(GAIN_ROUNDS):
        gain = np.abs(waves @ noise.kernel)
        ratio = np.where(wanted > 0.0, wanted / np.maximum(gain, 1e-30), 1.0)
        noise = replace(noise, damping=noise.damping * np.clip(ratio, 0.5, 2.0))
    return noise


def _typical_power(runs: Sequence[FloatArray], settings: FitSettings) -> tuple[FloatArray, FloatArray]:
    """Power spectrum of steady movement: geometric means over windows, so that volatile ones don't outweigh the others.

    (A periodogram's logarithm lies on average Euler's constant below that of the power.)

    Returns
    -------
    frequency, power : array
        In cycles per sample, and with white noise of variance 1 at 1 everywhere.
    """
    size = min(window_of(runs, settings.spectrum_windows, settings), max(map(len, runs)))
    power = np.concatenate([periodograms(run, size, detrend=Detrend.ENDS) for run in runs])
    frequency = np.fft.rfftfreq(size)
    typical = np.exp(np.log(power + 1e-30).mean(axis=0) + np.euler_gamma)
    return np.asarray(frequency, dtype=np.float64), np.asarray(typical)
