"""The paper's model to the letter: smoothed Markov chain + shaped uniform noise, x = kappa + phi.

Reference: N. Neis, J. Beyerer, "Modelling of lateral movement within the lane", arXiv:2405.17080, section III.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.core import Start
from xosc_lateral.driver.markov import N_BINS, MarkovChain, bin_of, fit_markov_chain, walk
from xosc_lateral.driver.noise import KERNEL_TAPS, N_KNOTS, ShapedNoise, convolve, fit_shaped_noise
from xosc_lateral.driver.pace import Paced
from xosc_lateral.driver.seeds import child
from xosc_lateral.driver.series import STEP
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TwoLevelSettings:
    """Constants of the model; the defaults are the paper's.

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
        Length of the kernel of the fine noise. (The paper gives none: one snippet.)
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

    @property
    def smoothing_kernel(self) -> FloatArray:
        """Gaussian weights that sum to 1, symmetric, odd in number."""
        half = round(self.smoothing_support / self.step)
        weights = np.exp(-0.5 * (np.arange(-half, half + 1) * self.step / self.smoothing_sigma) ** 2)
        return np.asarray(weights / weights.sum())


PAPER_SETTINGS = TwoLevelSettings()


@dataclass(frozen=True, eq=False, slots=True)
class TwoLevelModel:
    """Fitted two-level model.

    Parameters
    ----------
    chain : MarkovChain
        Coarse part, before smoothing.
    noise : ShapedNoise
        Fine part.
    settings : TwoLevelSettings
    """

    kind: ClassVar[str] = "two-level"

    chain: MarkovChain
    noise: ShapedNoise
    settings: TwoLevelSettings = PAPER_SETTINGS

    @property
    def step(self) -> float:
        """[s]"""
        return self.settings.step

    @property
    def mean(self) -> float:
        """Mean of the coarse part in the long run. [-]"""
        return self.chain.mean

    def stream(self, seed: np.random.SeedSequence, start: Start | None = None) -> TwoLevelStream:
        """Begin a drive; without `start` in a bin drawn from the stationary distribution."""
        return TwoLevelStream(self, seed, start)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "kind": self.kind,
            "settings": asdict(self.settings),
            "counts": self.chain.counts.tolist(),
            "damping": self.noise.damping.tolist(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Back from `to_dict`."""
        settings = TwoLevelSettings(**values["settings"])
        chain = MarkovChain(np.array(values["counts"], dtype=np.int64))
        if chain.n_bins != settings.n_bins:
            raise DriverProfileError(f"counts of {chain.n_bins} bins, settings of {settings.n_bins}")
        return cls(chain, ShapedNoise(np.array(values["damping"]), settings.n_taps), settings)


class TwoLevelStream:
    """One drive; see `CoreStream`. Chain and noise draw from generators of their own, one number a step each."""

    def __init__(self, model: TwoLevelModel, seed: np.random.SeedSequence, start: Start | None) -> None:
        self.mean = model.mean
        self._table = model.chain.alias_table
        self._centres = model.chain.centres
        self._smoothing, self._kernel = model.settings.smoothing_kernel, model.noise.kernel
        self._chain_rng = np.random.default_rng(child(seed, 0))
        self._noise_rng = np.random.default_rng(child(seed, 1))
        if start is None:
            bins = np.random.default_rng(child(seed, 2)).choice(model.chain.n_bins, p=model.chain.stationary)
        else:
            within = self.mean + (start.rel_offset - self.mean) / start.spread
            bins = bin_of(np.array([within]), model.chain.n_bins)[0]
        half = len(self._smoothing) // 2
        # Before its start the chain is taken to have stayed where it starts.
        self._state = int(bins)
        self._levels = np.full(half + 1, self._centres[bins])
        self._levels = np.concatenate([self._levels, self._walk(half - 1)])
        self._white = self._noise_rng.random(len(self._kernel) - 1) - 0.5
        self._pace = Paced(self._smoothed)
        self._fade = np.empty(0)
        if start is not None:
            self._fade = self._lack(start) * _fade_out(model.settings)

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part; see `CoreStream`."""
        coarse = self._pace.take(n, rate)
        fading = min(n, len(self._fade))
        if fading:
            coarse[:fading] += self._fade[:fading]
            self._fade = self._fade[fading:]
        return coarse, self._fine(n)

    def _lack(self, start: Start) -> float:
        """What the coarse part lacks at the first step to start as asked for. [-]"""
        from copy import deepcopy

        coarse, fine = deepcopy(self).take(1)
        unscaled = (start.rel_offset - self.mean - start.fine * fine[0]) / start.spread
        return float(self.mean + unscaled - coarse[0])

    def _walk(self, n: int) -> FloatArray:
        states = walk(self._table, self._state, self._chain_rng.random(n))
        if n:
            self._state = int(states[-1])
        return self._centres[states]

    def _smoothed(self, n: int) -> FloatArray:
        levels = np.concatenate([self._levels, self._walk(n)])
        self._levels = levels[n:]
        return convolve(levels, self._smoothing)

    def _fine(self, n: int) -> FloatArray:
        white = np.concatenate([self._white, self._noise_rng.random(n) - 0.5])
        self._white = white[n:]
        return convolve(white, self._kernel)


def _fade_out(settings: TwoLevelSettings) -> FloatArray:
    n = max(1, round(settings.start_fade / settings.step))
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.arange(n) / n))


def split_levels(rel_offset: FloatArray, settings: TwoLevelSettings = PAPER_SETTINGS) -> tuple[FloatArray, FloatArray]:
    """Split a measured run into its coarse part and its capped fine part.

    Parameters
    ----------
    rel_offset : array, shape (n,)
        One run at the model's step. [-]

    Returns
    -------
    coarse, fine : array, shape (n,)
        Bin centres smoothed (at the run's ends with the kernel's part that lies inside), and what is left, capped. [-]
    """
    rel_offset = np.asarray(rel_offset, dtype=np.float64)
    levels = (bin_of(rel_offset, settings.n_bins) + 0.5) / settings.n_bins - 0.5
    kernel = settings.smoothing_kernel
    half = len(kernel) // 2
    weight = convolve(np.pad(np.ones(len(levels)), half), kernel)
    coarse = convolve(np.pad(levels, half), kernel) / weight
    return coarse, np.clip(rel_offset - coarse, -settings.fine_cap, settings.fine_cap)


def fit_two_level(rel_offsets: Sequence[FloatArray], settings: TwoLevelSettings = PAPER_SETTINGS) -> TwoLevelModel:
    """Fit to relative offsets, one array per run, evenly sampled at the model's step.

    Raises
    ------
    NotEnoughDataError
        When there is no transition, or no run of 5 s.
    """
    chain = fit_markov_chain(rel_offsets, n_bins=settings.n_bins)
    fine = [split_levels(run, settings)[1] for run in rel_offsets]
    noise = fit_shaped_noise(fine, n_knots=settings.n_knots, n_taps=settings.n_taps)
    return TwoLevelModel(chain, noise, settings)
