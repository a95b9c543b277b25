"""Many short drives of our model at once, all steps vectorised over drives: for the simulations inside the fit.

Same distribution as `BestStream`, other random numbers: that one is for one drive of any length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.bands import COARSE_EVERY, TICKS, phases
from xosc_lateral.driver.best import MEMORY_OF_START, BestModel
from xosc_lateral.driver.best_stream import CANDIDATES

FloatArray = NDArray[np.float64]


def sample_batch(model: BestModel, starts: FloatArray, n: int, rng: np.random.Generator, *, start: bool) -> FloatArray:
    """Sample drives without limits.

    Parameters
    ----------
    model : BestModel
    starts : array, shape (m,)
        First values; only their number counts without `start`. [-]
    n : int
        Samples per drive.
    start : bool
        Whether drives start there.

    Returns
    -------
    array, shape (m, n)
        Relative offsets. [-]
    """
    m = len(starts)
    mean, coarse_factor, fine_factor = _drivers(model, starts, rng, start=start)
    half = len(model.kernel) // 2
    begin = max(half, COARSE_EVERY * TICKS)
    n_steps = (begin + COARSE_EVERY + n) // COARSE_EVERY + 2 * TICKS + 2 + half // COARSE_EVERY
    lively = _factors(model, m, n_steps, rng)
    skip = rng.integers(COARSE_EVERY, size=m)
    rows = np.arange(m)[:, None]
    coarse = _coarse(model, lively[0], rng)[rows, begin - COARSE_EVERY * TICKS + skip[:, None] + np.arange(n)]
    fine = _fine(model, lively[1], begin - half, begin + COARSE_EVERY + n + half, rng)[
        rows, skip[:, None] + np.arange(n)
    ]
    coarse *= coarse_factor[:, None]
    fine *= fine_factor[:, None]
    offsets = mean[:, None] + coarse + fine
    if start:
        lags = min(n, MEMORY_OF_START)
        covariance = np.outer(coarse_factor**2, model.coarse_covariance[:lags])
        covariance += np.outer(fine_factor**2, model.fine_covariance[:lags])
        offsets[:, :lags] += covariance / covariance[:, :1] * (starts - offsets[:, 0])[:, None]
    return np.asarray(offsets)


def _drivers(
    model: BestModel, starts: FloatArray, rng: np.random.Generator, *, start: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    m = len(starts)
    normal = rng.standard_normal((2, m, CANDIDATES))
    mixed = model.correlation * normal[0] + np.sqrt(1.0 - model.correlation**2) * normal[1]
    coarse = np.exp(np.sqrt(model.coarse_liveliness.between) * normal[0] - model.coarse_liveliness.between)
    fine = np.exp(np.sqrt(model.fine_liveliness.between) * mixed - model.fine_liveliness.between)
    between, own = model.between_drivers**2, rng.standard_normal(m)
    if not start:
        return model.mean + np.sqrt(between) * own, coarse[:, 0], fine[:, 0]
    moving = coarse**2 * model.coarse_covariance[0] + fine**2 * model.fine_covariance[0]
    away = starts - model.mean
    log_weight = -0.5 * np.log(between + moving) - 0.5 * away[:, None] ** 2 / (between + moving)
    weight = np.cumsum(np.exp(log_weight - log_weight.max(axis=1, keepdims=True)), axis=1)
    pick = (weight > weight[:, -1:] * rng.random((m, 1))).argmax(axis=1)
    rows = np.arange(m)
    share = between / (between + moving[rows, pick])
    mean = model.mean + share * away + np.sqrt(between * (1.0 - share)) * own
    return mean, coarse[rows, pick], fine[rows, pick]


def _factors(model: BestModel, m: int, n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Wandering factors at every coarse step, shape (m, n) each."""
    normal = rng.standard_normal((2, n, m))
    normal[1] = model.correlation * normal[0] + np.sqrt(1.0 - model.correlation**2) * normal[1]
    steady = rng.standard_normal((2, m))  # slow wander stands still during a short drive
    steady[1] = model.correlation * steady[0] + np.sqrt(1.0 - model.correlation**2) * steady[1]
    factors = []
    for part, noise, slow in zip((model.coarse_liveliness, model.fine_liveliness), normal, steady, strict=True):
        keep = np.exp(-model.step * COARSE_EVERY / part.memory)
        logs = noise * np.sqrt(part.within)
        for t in range(1, n):
            logs[t] = keep * logs[t - 1] + np.sqrt(1.0 - keep**2) * logs[t]
        factors.append(np.exp(logs + np.sqrt(part.slow) * slow - part.within - part.slow).T)
    return factors[0], factors[1]


def _coarse(model: BestModel, factors: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Coarse movement at 5 Hz; the first value belongs to coarse step `TICKS`."""
    m, n = factors.shape
    order = model.coarse.order
    reversed_coefficients = model.coarse.coefficients[::-1]
    steps = np.empty((m, order + n))
    steps[:, :order] = (rng.standard_normal((m, order)) @ model.start_factor.T) * factors[:, :1]
    noise = rng.standard_normal((m, n)) * model.coarse.scale * factors
    for t in range(n):
        steps[:, order + t] = steps[:, t : order + t] @ reversed_coefficients + noise[:, t]
    table = phases()
    windows = np.lib.stride_tricks.sliding_window_view(steps[:, order:], len(table), axis=1)
    return np.asarray((windows @ table).reshape(m, -1))


def _fine(model: BestModel, factors: FloatArray, first: int, last: int, rng: np.random.Generator) -> FloatArray:
    """Fine movement whose first value is centred half a kernel after sample `first`; noise up to sample `last`."""
    at = np.arange(first, last) / COARSE_EVERY
    step = at.astype(np.int64)
    share = at - step
    lively = factors[:, step] * (1.0 - share) + factors[:, step + 1] * share
    noise = (rng.random(lively.shape) - 0.5) * lively
    taps = len(model.kernel)
    band = np.zeros((noise.shape[1], noise.shape[1] - taps + 1))
    for k in range(taps):
        band[np.arange(band.shape[1]) + k, np.arange(band.shape[1])] = model.kernel[k]
    return np.asarray(noise @ band)
