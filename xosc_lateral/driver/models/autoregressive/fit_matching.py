"""Volatility of the autoregressive model, and rounds of simulating and comparing (indirect inference)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.autoregression import Autoregression
from xosc_lateral.driver.models.autoregressive.filters import COARSE_EVERY, split_bands
from xosc_lateral.driver.models.autoregressive.fit_settings import FitSettings
from xosc_lateral.driver.models.autoregressive.model import AutoregressiveModel
from xosc_lateral.driver.models.autoregressive.volatility import (
    MAX_LAG,
    Volatility,
    autocovariance,
    fit_volatility,
    log_power,
)
from xosc_lateral.driver.models.base import Start
from xosc_lateral.drives.periodogram import Detrend, window_powers

FloatArray = NDArray[np.float64]

LARGEST_STEP = float(np.log(1.5))
"""By which the fine noise's log amplitude changes at a frequency in one round: a whole step would overshoot where the
coarse movement outweighs it. [-]"""


def with_volatility(
    model: AutoregressiveModel, bands: Sequence[tuple[FloatArray, FloatArray]], population: bool, settings: FitSettings
) -> AutoregressiveModel:
    """Volatilities and their correlation from the excess covariance of log power over that of steady movement.

    From the slow and fast part of each run, shape (n_i,). [lane widths]
    """
    steady = simulate(model, 2000, settings.seed, drivers=64)
    reference = [split_bands(row, settings.step) for row in steady]
    found = []
    for which, seconds in ((_wiggle, settings.coarse_window), (_fine_of, settings.fine_window)):
        window = round(seconds / settings.step)
        n_lags = max(2, int(MAX_LAG / seconds))
        measured = [log_power(which(pair), window) for pair in bands if len(which(pair)) >= window]
        covariance, counts = autocovariance(measured, n_lags)
        expected, _ = autocovariance([log_power(which(pair), window) for pair in reference], n_lags)
        found.append(fit_volatility(covariance - expected, counts, seconds, population=population))
    floor = Volatility(0.0, 1e-3, 10.0)
    coarse, fine = (part if part.total > floor.total else floor for part in found)
    return replace(model, coarse_volatility=coarse, fine_volatility=fine, correlation=0.5)


def simulate(
    model: AutoregressiveModel, n: int, seed: int, *, drivers: int, starts: FloatArray | None = None
) -> FloatArray:
    """Drives of the model, for comparing.

    Parameters
    ----------
    n : int
        Samples per drive.
    starts : array, shape (drivers,), optional
        First values. [-]

    Returns
    -------
    array, shape (drivers, n)
        Relative offsets. [-]
    """
    start = None if starts is None else Start(starts)
    coarse, fine = model.stream(np.random.SeedSequence(seed), start, drivers=drivers).take(n)
    return np.ascontiguousarray((coarse + fine).T)


def _wiggle(pair: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Second difference of the slow part over a second: coarse movement without its slow wander."""
    slow, every = pair[0], COARSE_EVERY
    return np.asarray(slow[2 * every :] - 2.0 * slow[every:-every] + slow[: -2 * every])


def _fine_of(pair: tuple[FloatArray, FloatArray]) -> FloatArray:
    return pair[1]


def matched(model: AutoregressiveModel, runs: Sequence[FloatArray], settings: FitSettings) -> AutoregressiveModel:
    """Correct scales and volatilities until simulated snippets vary as the measured ones do.

    From runs of shape (n_i,) [lane widths]; indirect inference: C. Gourieroux, A. Monfort, E. Renault, Journal of
    Applied Econometrics 8 (1993), S85-S118.
    """
    length = round(settings.snippet / settings.step) + 1
    real = np.concatenate(
        [run[: len(run) // length * length].reshape(-1, length) for run in runs if len(run) >= length]
    )
    starts = np.resize(real[:, 0], max(settings.n_snippets, len(real)))
    target, spectrum = _moments(real), _log_spectrum(real)
    for _ in range(settings.rounds):
        simulated = simulate(model, length, settings.seed, drivers=len(starts), starts=starts)
        lacks = spectrum - _log_spectrum(simulated)
        model = _corrected(model, target - _moments(simulated), settings)
        model = replace(model, fine=replace(model.fine, damping=model.fine.damping * _gain(model, lacks)))
    return model


def _log_spectrum(snippets: FloatArray) -> FloatArray:
    """Mean log power of snippets at their own frequencies from 0 on, straight line from end to end taken out."""
    return np.asarray(np.log(window_powers(snippets[:, :-1], detrend=Detrend.ENDS) + 1e-30).mean(axis=0))


def _gain(model: AutoregressiveModel, lacks: FloatArray) -> FloatArray:
    """Factor on the damping at its knots from what the log spectrum of snippets lacks; knots without noise stay so."""
    knots = np.linspace(0.0, 0.5, len(model.fine.damping))
    known = np.linspace(0.0, 0.5, len(lacks))
    return np.asarray(np.exp(np.clip(0.5 * np.interp(knots, known, lacks), -LARGEST_STEP, LARGEST_STEP)))


def _moments(snippets: FloatArray) -> FloatArray:
    """What snippets are compared by, from the logarithms of three standard deviations of each.

    Mean and variance of that of the offset (spread), of its first difference (speed) and of its second difference
    (roughness), and the covariance of spread and roughness.
    """
    spread, speed, rough = (np.log(np.diff(snippets, k, axis=1).std(axis=1) + 1e-12) for k in range(3))
    spreads = (part for series in (spread, speed, rough) for part in (series.mean(), series.var()))
    return np.array([*spreads, np.mean((spread - spread.mean()) * (rough - rough.mean()))])


def _corrected(model: AutoregressiveModel, lacks: FloatArray, settings: FitSettings) -> AutoregressiveModel:
    """The model with each parameter moved against what its moment lacks."""
    coarse, fine = model.coarse_volatility, model.fine_volatility
    spread_mean, spread_variance, speed_mean, speed_variance, _, rough_variance, covariance = lacks
    larger = np.exp((1.0 - settings.speed_weight) * spread_mean + settings.speed_weight * speed_mean)
    # Calm and volatile snippets differ in spread and in speed; one variance has to serve both and meets them half-way.
    factors = [
        float(np.clip(1.0 + gain * lack / max(part.total, 0.02), 0.5, 2.0))
        for gain, lack, part in (
            (settings.coarse_gain, 0.5 * (spread_variance + speed_variance), coarse),
            (settings.fine_gain, rough_variance, fine),
        )
    ]
    both = max(np.sqrt(coarse.total * fine.total), 0.02)
    return replace(
        model,
        coarse=Autoregression(model.coarse.coefficients, model.coarse.scale * float(larger)),
        coarse_volatility=coarse.scaled(factors[0]),
        fine_volatility=fine.scaled(factors[1]),
        correlation=float(np.clip(model.correlation + covariance / both, 0.0, 0.95)),
    )
