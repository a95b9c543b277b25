"""Parameters of the autoregressive model, and what follows from them.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: coarse and fine part of the offset, here with other processes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.coarse import COARSE_EVERY, Autoregression, building_low_pass
from xosc_lateral.driver.models.autoregressive.volatility import Volatility
from xosc_lateral.driver.models.base import CoreModel
from xosc_lateral.driver.models.noise import NOISE_VARIANCE, ShapedNoise
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

START_LAGS = 300
"""Steps after which a drive has forgotten the offset that it was made to start at: 60 s. [-]"""


class AutoregressiveParameters(CoreModel, frozen=True, eq=False, dict=True):
    """Parameters of the model.

    Raises `DriverProfileError` if a number is out of its range.

    Parameters
    ----------
    mean : float
        Mean offset of all drivers. [lane widths]
    between_drivers : float
        Standard deviation of the drivers' means. [lane widths]
    limits : tuple of float
        Coarse movement bends back before these: the range of the data, the markings at most. [lane widths]
    coarse : Autoregression
        Of the coarse movement about the driver's mean, one step a second. [lane widths]
    fine : ShapedNoise
        Damping of the fine noise. [lane widths]
    coarse_volatility, fine_volatility : Volatility
    correlation : float
        Between the logarithms of the two factors. [-]
    step : float
        [s]
    """

    mean: float
    between_drivers: float
    limits: tuple[float, float]
    coarse: Autoregression
    fine: ShapedNoise
    coarse_volatility: Volatility
    fine_volatility: Volatility
    correlation: float
    step: float = STEP

    def __post_init__(self) -> None:
        """Check."""
        low, high = self.limits
        if not -1.0 <= low < self.mean < high <= 1.0:
            raise DriverProfileError(f"mean {self.mean} outside the limits {low} and {high}, or these beyond -1 and 1")
        if not (0.0 <= self.between_drivers < 1.0 and -1.0 <= self.correlation <= 1.0):
            raise DriverProfileError(f"between drivers {self.between_drivers}, correlation {self.correlation}")

    @cached_property
    def kernel(self) -> FloatArray:
        """Kernel of the fine noise, shape (n_taps,). [lane widths]"""
        return self.fine.kernel

    @cached_property
    def coarse_covariance(self) -> FloatArray:
        """Of the coarse movement about the driver's mean at lags of 0.2 s, mean over the phases of a coarse step.

        Shape (START_LAGS,). [lane widths squared]
        """
        n_ticks = START_LAGS // COARSE_EVERY + 20
        ticks = self.coarse.covariance(n_ticks)
        spread = np.zeros(2 * n_ticks * COARSE_EVERY - 1)
        middle = n_ticks * COARSE_EVERY - 1
        spread[middle::COARSE_EVERY][:n_ticks] = ticks
        spread[middle::-COARSE_EVERY][:n_ticks] = ticks
        kernel = building_low_pass()
        both = np.convolve(kernel, kernel) / COARSE_EVERY
        return np.asarray(np.convolve(spread, both, "same")[middle : middle + START_LAGS])

    @cached_property
    def fine_covariance(self) -> FloatArray:
        """Of the fine movement at lags of 0.2 s, shape (START_LAGS,). [lane widths squared]"""
        kernel = self.kernel
        full = np.convolve(kernel, kernel)[len(kernel) - 1 :] * NOISE_VARIANCE
        result = np.zeros(START_LAGS)
        result[: len(full)] = full[:START_LAGS]
        return result

    @cached_property
    def start_factor(self) -> FloatArray:
        """Lower triangle that turns white noise into a stationary past, shape (order, order). [lane widths]"""
        order = self.coarse.order
        covariance = self.coarse.covariance(order)
        if not covariance[0] > 0.0:  # coarse movement that is none has a past of none
            return np.zeros((order, order))
        matrix = covariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        return np.asarray(np.linalg.cholesky(matrix + 1e-9 * covariance[0] * np.eye(order)))


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Constants of the fit.

    Parameters
    ----------
    order : int
        Memory of the coarse movement. [s]
    n_knots : int
        Knots of the fine noise's damping.
    n_taps, taper : int, float
        Of its kernel: measured noise falls by five decades between 0.3 and 2.5 Hz, so nothing may leak.
    scale_band : tuple of float
        Frequencies at which all power is taken to be coarse. [Hz]
    fine_from : tuple of float
        The fine noise has nothing below the first frequency, all that the coarse movement lacks above the second. [Hz]
    spectrum_windows : tuple of float
        Lengths of spectral windows, the first that enough runs are as long as. [s]
    compared_windows : tuple of float
        Lengths of the windows whose spectra are compared, likewise. The power falls by 14 dB from 0.3 to 0.5 Hz, which
        windows of 10 s can't show: each of their frequencies is 0.4 Hz wide. [s]
    fine_window, coarse_window : float
        Windows that volatility is seen by. [s]
    far : tuple of float
        Two moments are far apart when this share of the typical run (by time) is between them, up to `farthest`.
    farthest : float
        [s]
    snippet : float
        Length of the snippets that are compared. [s]
    rounds : int
        Of simulating and comparing: more change nothing beyond the standard error of held-out drives.
    seed : int
        Of the simulations.
    """

    order: int = 16
    n_knots: int = 51
    n_taps: int = 71
    taper: float = 5.0
    scale_band: tuple[float, float] = (0.1, 0.3)
    fine_from: tuple[float, float] = (0.2, 0.33)
    spectrum_windows: tuple[float, ...] = (20.0, 10.0, 5.0)
    compared_windows: tuple[float, ...] = (30.0, 20.0, 10.0)
    fine_window: float = 2.0
    coarse_window: float = 5.0
    far: tuple[float, float] = (0.5, 1.0)
    farthest: float = 120.0
    snippet: float = 10.0
    rounds: int = 3
    seed: int = 20240517
    step: float = STEP


DEFAULT_SETTINGS = FitSettings()
