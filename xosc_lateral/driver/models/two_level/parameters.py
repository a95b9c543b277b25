"""Parameters of the two-level model, and the paper's constants."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.base import CoreModel
from xosc_lateral.driver.models.noise import ShapedNoise
from xosc_lateral.driver.models.two_level.markov import MarkovChain
from xosc_lateral.driver.models.two_level.settings import TwoLevelSettings
from xosc_lateral.driver.records import frozen_array, set_once
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]
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
