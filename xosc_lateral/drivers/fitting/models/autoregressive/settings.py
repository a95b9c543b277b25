"""Constants of the fit of the autoregressive model."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.drivers.drives.resampling import STEP


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Constants of the fit."""

    order: int = 16
    """Memory of the coarse movement. [s]"""
    n_knots: int = 51
    """Knots of the fine noise's damping."""
    n_taps: int = 71
    taper: float = 5.0
    """Of its kernel: measured noise falls by five decades between 0.3 and 2.5 Hz, so nothing may leak."""
    scale_band: tuple[float, float] = (0.1, 0.3)
    """Frequencies at which all power is taken to be coarse. [Hz]"""
    fine_from: tuple[float, float] = (0.2, 0.33)
    """The fine noise has nothing below the first frequency, all that the coarse movement lacks above the second. [Hz]
    """
    spectrum_windows: tuple[float, ...] = (20.0, 10.0, 5.0)
    """Lengths of spectral windows, the first that enough runs are as long as. [s]"""
    compared_windows: tuple[float, ...] = (30.0, 20.0, 10.0)
    """Lengths of the windows whose spectra are compared, likewise. The power falls by 14 dB from 0.3 to 0.5 Hz, which
    windows of 10 s can't show: each of their frequencies is 0.4 Hz wide. [s]"""
    fine_window: float = 2.0
    coarse_window: float = 5.0
    """Windows that volatility is seen by. [s]"""
    far: tuple[float, float] = (0.5, 1.0)
    """Two moments are far apart when this share of the typical run (by time) is between them, up to `farthest`."""
    farthest: float = 120.0
    """[s]"""
    snippet: float = 10.0
    """Length of the snippets that are compared. [s]"""
    rounds: int = 3
    """Of simulating and comparing: more change nothing beyond the standard error of held-out drives."""
    seed: int = 20240517
    """Of the simulations."""
    step: float = STEP


DEFAULT_SETTINGS = FitSettings()
