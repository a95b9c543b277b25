"""Coarse movement of a population, and fine noise that has what its spectrum lacks.

One autoregression, and drivers' own means about which it moves: both are fitted to the low-passed offset at once
(`fit_autoregression`), and then the autoregression gets back what the low-pass took near the border.

References
----------
.. [1] G. Wahba, "Automatic smoothing of the log periodogram", J. American Statistical Association 75, 1980.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.drives.filters import Detrend, periodograms
from xosc_lateral.drivers.fitting.models.likelihood import fit_autoregression
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    COARSE_EVERY,
    FREQUENCIES,
    GRID,
    Autoregression,
    building_low_pass,
    measuring_low_pass,
    stabilise,
)
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE, ShapedNoise

RIDGE = 1e-7
"""Share of the mean square that is added to the normal equations' diagonal. [-]"""

HALF_GAIN = 0.5
"""Of the measuring low-pass at its border. Beyond, most is not coarse, and the building low-pass takes it away. [-]"""


def fit_coarse(
    slow: Sequence[FloatArray], drives: Sequence[str], settings: FitSettings
) -> tuple[Autoregression, float]:
    """Autoregression at one step a second [lane widths], and the variance between drivers [lane widths squared].

    From low-passed runs at 5 Hz, shape (n_i,), [lane widths], and whose drive each is of.
    """
    longest = max(map(len, slow)) * settings.step
    order = max(2, min(settings.order, int(0.4 * longest)))
    coarse, between = fit_autoregression(slow, order, every=COARSE_EVERY, drivers=drives)
    return _restored(coarse, settings.step), between


def _restored(coarse: Autoregression, step: float) -> Autoregression:
    """With what the measuring low-pass took below the border; `step` of the runs. [s]"""
    kernel = measuring_low_pass(step)
    gain = np.abs(np.exp(-2j * np.pi * np.outer(FREQUENCIES / COARSE_EVERY, np.arange(len(kernel)))) @ kernel)
    return scaled_spectrum(coarse, 1.0 / np.maximum(gain, HALF_GAIN))


def scaled_spectrum(coarse: Autoregression, gain: FloatArray) -> Autoregression:
    """One of the same order with the spectrum's amplitude times a gain, by the covariance of that spectrum.

    `gain` at `FREQUENCIES`. [-]
    """
    from scipy.linalg import solve_toeplitz

    power = coarse.power(FREQUENCIES) * gain**2
    covariance = np.fft.irfft(power, GRID)[: coarse.order + 1]
    row = covariance[:-1].copy()
    row[0] *= 1.0 + RIDGE
    coefficients = solve_toeplitz(row, covariance[1:])
    scale = float(np.sqrt(covariance[0] - coefficients @ covariance[1:]))
    return Autoregression(stabilise(coefficients), scale)


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
    slow_power = coarse_power(coarse, knots)
    measured = np.exp(np.interp(knots, frequency, np.log(power)))
    hertz = knots / settings.step
    shared = (hertz >= settings.scale_band[0]) & (hertz <= settings.scale_band[1])
    scale = float(np.exp(np.log(measured[shared] / slow_power[shared]).mean()))
    lacking = np.maximum(measured - scale * slow_power, 0.0)
    noise = shaped(np.sqrt(lacking / NOISE_VARIANCE) * rise(hertz, settings), settings)
    return replace(coarse, scale=coarse.scale * np.sqrt(scale)), noise


def coarse_power(coarse: Autoregression, knots: FloatArray) -> FloatArray:
    """Of the coarse movement at 5 Hz, shape of `knots` [cycles per sample]. [lane widths squared]"""
    kernel = building_low_pass()
    gain = np.abs(np.exp(-2j * np.pi * np.outer(knots, np.arange(len(kernel)))) @ kernel)
    return np.asarray(coarse.power(knots * COARSE_EVERY) * gain**2 / COARSE_EVERY)


def fine_power(fine: ShapedNoise, knots: FloatArray) -> FloatArray:
    """Of the fine movement, likewise; white noise of variance 1 has 1."""
    waves = np.exp(-2j * np.pi * np.outer(knots, np.arange(len(fine.kernel))))
    return np.asarray(NOISE_VARIANCE * np.abs(waves @ fine.kernel) ** 2)


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


def shaped(wanted: FloatArray, settings: FitSettings) -> ShapedNoise:
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
    """Frequencies [cycles per sample] and power of steady movement; white noise of variance 1 has 1 everywhere.

    Geometric means over windows, so that volatile ones don't outweigh the others. (A periodogram's logarithm lies on
    average Euler's constant below that of the power.)
    """
    size = min(window_of(runs, settings.spectrum_windows, settings), max(map(len, runs)))
    power = np.concatenate([periodograms(run, size, detrend=Detrend.ENDS) for run in runs])
    frequency = np.fft.rfftfreq(size)
    typical = np.exp(np.log(power + 1e-30).mean(axis=0) + np.euler_gamma)
    return np.asarray(frequency, dtype=np.float64), np.asarray(typical)


# ---- Constants of the fit of the autoregressive model ----
@dataclass(frozen=True, slots=True)
class FitSettings:
    """Constants of the fit."""

    order: int = 16  # Memory of the coarse movement. [s]
    n_knots: int = 51  # Knots of the fine noise's damping.
    n_taps: int = 71
    # Of its kernel: measured noise falls by five decades between 0.3 and 2.5 Hz, so nothing may leak.
    taper: float = 5.0
    scale_band: tuple[float, float] = (0.1, 0.3)  # Frequencies at which all power is taken to be coarse. [Hz]
    # The fine noise has nothing below the first frequency, all that the coarse movement lacks above the second. [Hz]
    fine_from: tuple[float, float] = (0.2, 0.33)
    # Lengths of spectral windows, the first that enough runs are as long as. [s]
    spectrum_windows: tuple[float, ...] = (20.0, 10.0, 5.0)
    # Lengths of the windows whose spectra are compared, likewise. The power falls by 14 dB from 0.3 to 0.5 Hz, which
    # windows of 10 s can't show: each of their frequencies is 0.4 Hz wide. [s]
    compared_windows: tuple[float, ...] = (30.0, 20.0, 10.0)
    fine_window: float = 2.0
    coarse_window: float = 5.0  # Windows that volatility is seen by. [s]
    snippet: float = 10.0  # Length of the snippets that are compared. [s]
    rounds: int = 3  # Of simulating and comparing: more change nothing beyond the standard error of held-out drives.
    effort: float = 1.0  # Share of the usual number of drivers that rounds simulate. [-]
    seed: int = 20240517  # Of the simulations.
    step: float = STEP


DEFAULT_SETTINGS = FitSettings()
