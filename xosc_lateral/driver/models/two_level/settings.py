"""Parameters of the two-level model, the paper's constants, and others in their place."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.base import CoreModel
from xosc_lateral.driver.models.noise import KERNEL_TAPS, N_KNOTS, ShapedNoise
from xosc_lateral.driver.models.two_level.markov import N_BINS, MarkovChain
from xosc_lateral.driver.records import Record, frozen_array, set_once
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class TwoLevelSettings(Record, frozen=True):
    """Constants of the model; the defaults are the paper's.

    Raises `DriverProfileError` if a number is not above 0.

    Parameters
    ----------
    n_bins : int
        Bins of the relative offset over [-0.5, 0.5].
    smoothing_sigma : float
        Standard deviation of the Gaussian that smooths the chain's step function. [s]
    smoothing_support : float
        It is cut off at this distance to both sides. [s]
    fine_cap : float
        The measured fine part is capped at plus and minus this. [lane widths]
    n_knots : int
        Knots of the piecewise linear damping function. (The paper shows a figure, no count.)
    n_taps : int
        Length of the kernel of the fine noise, odd. (The paper gives none: one snippet.)
    start_fade : float
        A drive that has to start at a given offset meets it exactly; what the smoothed chain lacks to it fades out
        within this time. (The paper's starts in the right bin.) [s]
    step : float
        [s]
    """

    n_bins: int = N_BINS
    smoothing_sigma: float = 0.6
    smoothing_support: float = 1.0
    fine_cap: float = 0.03
    n_knots: int = N_KNOTS
    n_taps: int = KERNEL_TAPS
    start_fade: float = 1.0
    step: float = STEP

    def __post_init__(self) -> None:
        """Check."""
        for name in self.__struct_fields__:
            if not 0 < getattr(self, name) < np.inf:
                raise DriverProfileError(f"{name} {getattr(self, name)}, expected above 0")

    @property
    def smoothing_kernel(self) -> FloatArray:
        """Gaussian weights that sum to 1, shape (2 * support / step + 1,) [-]; arXiv:2405.17080, section III."""
        half = round(self.smoothing_support / self.step)
        weights = np.exp(-0.5 * (np.arange(-half, half + 1) * self.step / self.smoothing_sigma) ** 2)
        return np.asarray(weights / weights.sum())


PAPER_SETTINGS = TwoLevelSettings()


IntArray = NDArray[np.int64]


class TwoLevelParameters(CoreModel, frozen=True, eq=False, dict=True):
    """Fitted two-level model: x = kappa + phi.

    Raises `DriverProfileError` if counts and settings disagree, or counts or damping are none.

    Parameters
    ----------
    settings : TwoLevelSettings
    counts : array of int, shape (n_bins, n_bins)
        Transitions of the coarse part before smoothing, from the row's bin to the column's in one step.
    damping : array, shape (n_knots,)
        Of the fine part's noise, at frequencies evenly spaced from 0 to half the sampling rate. [lane widths]
    """

    settings: TwoLevelSettings
    counts: IntArray
    damping: FloatArray

    def __post_init__(self) -> None:
        """Check."""
        set_once(self, counts=frozen_array(self.counts, np.int64), damping=frozen_array(self.damping))
        if self.chain.n_bins != self.settings.n_bins:
            raise DriverProfileError(f"counts of {self.chain.n_bins} bins, settings of {self.settings.n_bins}")
        assert self.noise

    @cached_property
    def chain(self) -> MarkovChain:
        """Coarse part, before smoothing."""
        return MarkovChain(self.counts)

    @cached_property
    def noise(self) -> ShapedNoise:
        """Fine part."""
        return ShapedNoise(self.damping, self.settings.n_taps)

    @property
    def step(self) -> float:
        """[s]"""
        return self.settings.step

    @property
    def mean(self) -> float:
        """Mean of the coarse part in the long run. [-]"""
        return self.chain.mean
