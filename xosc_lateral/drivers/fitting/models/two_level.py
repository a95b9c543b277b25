"""Fitting of the two-level model: count transitions, shape the noise like what is left.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080, section III.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import in_digits
from xosc_lateral.drivers.drives.filters import periodograms
from xosc_lateral.drivers.model.core.base import KERNEL_TAPS, N_KNOTS, NOISE_VARIANCE, ShapedNoise
from xosc_lateral.drivers.model.core.two_level.model import (
    N_BINS,
    PAPER_SETTINGS,
    MarkovChain,
    TwoLevelModel,
    TwoLevelSettings,
    bin_of,
)
from xosc_lateral.drivers.model.linear_filters import convolve


def split_levels(rel_offset: FloatArray, settings: TwoLevelSettings = PAPER_SETTINGS) -> tuple[FloatArray, FloatArray]:
    """Coarse part and capped fine part of a measured run at the model's step, shape (n,) each. [-]

    Bin centres smoothed (at the run's ends with the kernel's part that lies inside), and what is left, capped.
    """
    rel_offset = np.asarray(rel_offset, dtype=np.float64)
    levels = (bin_of(rel_offset, settings.n_bins) + 0.5) / settings.n_bins - 0.5
    kernel = settings.smoothing_kernel
    half = len(kernel) // 2
    weight = convolve(np.pad(np.ones(len(levels)), half), kernel)
    coarse = convolve(np.pad(levels, half), kernel) / weight
    return coarse, np.clip(rel_offset - coarse, -settings.fine_cap, settings.fine_cap)


def fit_markov_chain(rel_offsets: Sequence[FloatArray], *, n_bins: int = N_BINS) -> MarkovChain:
    """Count transitions inside each run of relative offsets [-], shape (n_i,) each; none across two runs.

    Raises `NotEnoughDataError` when there is no transition.
    """
    counts = np.zeros((n_bins, n_bins), dtype=np.int64)
    for run in rel_offsets:
        bins = bin_of(np.asarray(run), n_bins)
        np.add.at(counts, (bins[:-1], bins[1:]), 1)
    if not counts.any():
        raise NotEnoughDataError(f"{len(rel_offsets)} runs hold no two successive offsets: nothing to fit")
    return MarkovChain(counts)


def fit_shaped_noise(
    fine_parts: Sequence[FloatArray], *, n_knots: int = N_KNOTS, n_taps: int = KERNEL_TAPS
) -> ShapedNoise:
    """Fit the damping function to measured fine parts [lane widths], one array of shape (n_i,) per run.

    Raises `NotEnoughDataError` when no run holds a window of 5 s.
    """
    longest = max(map(len, fine_parts), default=0)
    window = min(n_taps - 1, longest)
    if window < n_taps // 2:
        raise NotEnoughDataError(f"the longest fine part has {longest} values, {n_taps // 2} are needed")
    power = mean_power(fine_parts, window)
    at = np.linspace(0.0, 1.0, len(power))
    hats = np.maximum(0.0, 1.0 - np.abs(at[:, None] * (n_knots - 1) - np.arange(n_knots)[None, :]))
    damping = in_digits(np.linalg.lstsq(hats, np.sqrt(power / NOISE_VARIANCE), rcond=None)[0])
    return ShapedNoise(np.maximum(damping, 0.0), n_taps)


def mean_power(parts: Sequence[FloatArray], window: int) -> FloatArray:
    """Mean power per frequency over half-overlapping Hann windows, shape (window // 2 + 1,). [square of the unit]"""
    total, count = np.zeros(window // 2 + 1), 0
    for part in parts:
        powers = periodograms(part, window)
        total += powers.sum(axis=0)
        count += len(powers)
    return total / max(count, 1)


def fit_two_level(rel_offsets: Sequence[FloatArray], settings: TwoLevelSettings = PAPER_SETTINGS) -> TwoLevelModel:
    """Fit to relative offsets [-], one array of shape (n_i,) per run, evenly sampled at the model's step.

    Raises `NotEnoughDataError` when there is no transition, or no run of 5 s.
    """
    chain = fit_markov_chain(rel_offsets, n_bins=settings.n_bins)
    fine = [split_levels(run, settings)[1] for run in rel_offsets]
    noise = fit_shaped_noise(fine, n_knots=settings.n_knots, n_taps=settings.n_taps)
    return TwoLevelModel(settings, chain.counts, noise.damping)


# ---- parameters freed of what their own fit does to them, by indirect inference ----
# Fitted to drives that were sampled from it, the model comes out with bins that are left a third too seldom (the
# smoothed chain passes an edge later and less often than the chain does) and other damping
# (`laboratory/two_level_bias.py`). Here parameters are sought of which samples, fitted again, give what was fitted to
# the measured drives [1]_.
# [1] C. Gourieroux, A. Monfort, E. Renault, "Indirect inference", J. Applied Econometrics 8, 1993.

ROUNDS, STEPS = 6, 200_000  # Rounds, and simulated steps of each: 11 h, whose scatter is a per cent.
PARTS_EACH = 100  # Of a transition: counts are whole numbers.
LARGEST_CHANGE = 2.0  # Factor of one round, at most. [-]
SEED = 0  # The same each time: same drives, same profile.


def correct_two_level(model: TwoLevelModel) -> TwoLevelModel:
    """The model whose samples, fitted again, are like the one given: leaving rate of all bins together, and damping."""
    target, corrected = leaving_rate(model.counts), model
    factor, damping, total = 1.0, np.array(model.damping), model.counts.sum(axis=1)
    out = model.counts * ~np.eye(len(total), dtype=np.bool_)  # transitions out of their bin, at most all of them
    for number in range(ROUNDS):
        stream = corrected.stream(np.random.SeedSequence([SEED, number]))
        again = fit_two_level([np.sum(stream.take(STEPS), axis=0)], model.settings)
        factor *= float(_bounded(target / max(leaving_rate(again.counts), 1e-12)))
        damping = damping * _bounded(model.damping / np.maximum(again.damping, 1e-12))
        most = np.minimum(factor, total / np.maximum(out.sum(axis=1), 1))
        parts = np.rint(PARTS_EACH * out * most[:, None]).astype(np.int64)
        counts = parts + np.diag(np.maximum(PARTS_EACH * total - parts.sum(axis=1), 0))
        corrected = TwoLevelModel(model.settings, counts, damping)
    return corrected


def leaving_rate(counts: IntArray) -> float:
    """Share of transitions that leave their bin. [-]"""
    return 1.0 - float(np.trace(counts)) / float(counts.sum())


def _bounded(ratio: FloatArray | float) -> FloatArray:
    return np.clip(ratio, 1.0 / LARGEST_CHANGE, LARGEST_CHANGE)
