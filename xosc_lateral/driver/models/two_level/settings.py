"""The paper's constants, and others in their place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.noise import KERNEL_TAPS, N_KNOTS
from xosc_lateral.driver.models.two_level.markov import N_BINS
from xosc_lateral.driver.records import Record
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
