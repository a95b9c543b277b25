"""Fitting our model. First what can be read off the data, then a few rounds of simulating and comparing.

1. Mean of all.
2. Coarse movement and the variance between drivers (`fit_coarse`).
3. Fine noise: what the coarse movement lacks of the offset's power spectrum, geometric mean over windows.
4. Volatility [2]_: how much more, and for how long, the power in short windows varies than it would in steady movement.
   One drive alone does not separate what its driver keeps from what varies slowly: all that lasts longer than the lags
   counts as slow variation there, and as a difference between drivers where there are several.
5. Rounds of simulating: snippets of the model from the measured snippets' starts must show the same moments of log
   standard deviation, of the offset and of its differences. What differs corrects the scales, the volatilities and
   their correlation, and windows of both the spectrum of either part (indirect inference [1]_).
6. Bursts, as far as the kurtosis of lateral speed shows them beyond chance (`bursts`).

Everything is deterministic: the simulations draw from a fixed seed.

References
----------
.. [1] C. Gourieroux, A. Monfort, E. Renault, "Indirect inference", J. Applied Econometrics 8, 1993, pp. S85-S118.
.. [2] S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from msgspec.structs import replace
from numpy.lib.stride_tricks import sliding_window_view

from xosc_lateral.base.arrays import FloatArray, all_significant, significant
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.filters import Detrend, periodograms
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import (
    DEFAULT_SETTINGS,
    FitSettings,
    fit_coarse,
    fit_spectrum,
    rise,
    scaled_spectrum,
    window_of,
)
from xosc_lateral.drivers.fitting.models.bursts import with_bursts
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    BORDER,
    COARSE_EVERY,
    FREQUENCIES,
    Autoregression,
    Volatility,
    averaged_covariance,
    largest_root,
    split_bands,
)
from xosc_lateral.drivers.model.core.base import Start

DIGITS = 5
"""Significant digits kept of a fitted number: a hundredth of its standard error and less. What another processor gives
differs by up to a hundred millionth (linear algebra in another order), so that one number in 10,000 is rounded to
another last digit there. [-]"""

MAXIMUM_LOG_POWER_CHANGE = 2e-3
"""Largest change of the coarse movement's log power that rounding may make at any frequency: 0.01 dB. Coefficients of
an autoregression nearly add up to one, and what they lack of it decides how far a driver wanders. [-]"""

HELD_SECONDS, HELD_WITHIN, HELD_SHARE = 3.0, 120.0, 0.01
"""Limits lie where coarse movement stays beyond for so long in so long a drive with this chance: extremes of few
drivers' minutes lie nearer, and their drivers would sit at them (17.7 % of two-minute runs). [s], [s], [-]"""

HELD_DRIVES = 500
"""Simulated for that: a standard error of 0.4 % for the share of 1 %. [-]"""

MOST_DIGITS = 17
"""That a number has. [-]"""


def rounded(model: AutoregressiveModel) -> AutoregressiveModel:
    """The same with every number rounded to what is kept of it."""
    return replace(
        model,
        **{name: significant(getattr(model, name), DIGITS) for name in ("mean", "between_drivers", "correlation")},
        coarse=_tidy_coarse(model.coarse),
        fine=replace(model.fine, damping=np.array(all_significant(model.fine.damping, DIGITS))),
        coarse_volatility=_tidy_volatility(model.coarse_volatility),
        fine_volatility=_tidy_volatility(model.fine_volatility),
        limits=all_significant(model.limits, DIGITS),
    )


def _tidy_coarse(coarse: Autoregression) -> Autoregression:
    """With as few digits as keep the spectrum, and with it a stable autoregression stable."""
    power = np.log(coarse.power(FREQUENCIES))
    for digits in range(DIGITS, MOST_DIGITS):
        coefficients, scale = np.array(all_significant(coarse.coefficients, digits)), significant(coarse.scale, digits)
        if largest_root(coefficients) >= 1.0:
            continue
        short = Autoregression(coefficients, scale)
        if np.abs(np.log(short.power(FREQUENCIES)) - power).max() <= MAXIMUM_LOG_POWER_CHANGE:
            return short
    return coarse


def _tidy_volatility(part: Volatility) -> Volatility:
    return Volatility(*all_significant((part.between, part.within, part.correlation_time, part.slow), DIGITS))


def _limits(offsets: FloatArray, mean: float, reach: float = 0.0) -> tuple[float, float]:
    """What was recorded, so far from the mean at least, the markings at most. [lane widths]"""
    low, high = max(-0.5, min(float(offsets.min()), mean - reach)), min(0.5, max(float(offsets.max()), mean + reach))
    return min(low, mean - 1e-3), max(high, mean + 1e-3)


def _held_reach(model: AutoregressiveModel, settings: FitSettings) -> float:
    """Distance from the mean beyond which free coarse movement is held so seldom that a limit there is hardly seen."""
    free = replace(model, limits=(-1.0, 1.0)).stream(np.random.SeedSequence(settings.seed), drivers=HELD_DRIVES)
    away = np.abs(free.take(round(HELD_WITHIN / model.step))[0] - model.mean)
    held = sliding_window_view(away, round(HELD_SECONDS / model.step), axis=0).min(axis=-1).max(axis=0)
    return float(np.quantile(held, 1.0 - HELD_SHARE))


def fit_autoregressive(
    rel_offsets: Sequence[FloatArray], drives: Sequence[str], settings: FitSettings = DEFAULT_SETTINGS
) -> AutoregressiveModel:
    """Fit to relative offsets [-], one array of shape (n_i,) per run at 5 Hz; runs of one drive are of one driver.

    Raises `NotEnoughDataError` when no run lasts one snippet, or the offset never moves.
    """
    runs = [np.asarray(run, dtype=np.float64) for run in rel_offsets]
    longest = max(map(len, runs), default=0)
    if longest < round(settings.snippet / settings.step) + 1:
        raise NotEnoughDataError(
            f"the longest run lasts {longest * settings.step:.1f} s, the fit needs {settings.snippet:g} s"
        )
    everything = np.concatenate(runs)
    if everything.std() < 1e-7:
        raise NotEnoughDataError(f"the offset never moves: standard deviation {everything.std():.2g} lane widths")
    mean = float(everything.mean())
    bands = [split_bands(run, settings.step) for run in runs]
    coarse, between = fit_coarse([slow - mean for slow, _ in bands], drives, settings)
    coarse, fine = fit_spectrum(runs, coarse, settings)
    model = AutoregressiveModel(
        mean=mean,
        between_drivers=float(np.sqrt(between)),
        coarse=coarse,
        fine=fine,
        coarse_volatility=Volatility(),
        fine_volatility=Volatility(),
        correlation=0.0,
        limits=_limits(everything, mean),
        step=settings.step,
    )
    model = with_volatility(model, bands, len(set(drives)) > 1, settings)
    model = matched(replace(model, limits=_limits(everything, mean, _held_reach(model, settings))), runs, settings)
    length = round(settings.snippet / settings.step) + 1
    few = round(settings.effort * SIMULATED_DRIVERS)
    model = with_bursts(model, runs, drives, lambda made: _drives_of(made, length, settings.seed, few))
    return rounded(replace(model, limits=_limits(everything, mean, _held_reach(model, settings))))


# ---- volatility, and rounds of simulating and comparing ----
SIMULATED_DRIVERS, SNIPPETS_EACH = 4000, 3
"""Drivers that a round simulates at once, and snippets of each: what chance does to the mean log spread of so many is
0.6 %. [-]"""

FOR_EACH, MOST_SIMULATED = 64, 32_000
"""Snippets that the last round simulates for each measured one, and drivers at most. All fits draw from one seed, so
that chance is a bias of every profile: an eighth of the data's own error, and 0.2 % at least. [-]"""

LEAST_VOLATILITY = Volatility(0.0, 1e-3, 10.0)
"""Of a movement that seems steady: rounds scale a volatility, and from none nothing grows. 3 % up and down."""

VARIANCE_NUDGE = float(np.log(2.0))
"""Change of the log variance of the volatilities by which the moments' slopes are measured, and the largest that a
round makes: beyond, the slopes are extrapolated. [-]"""

LEAST_SLOPE = 1e-6
"""Of what is asked, where a volatility shows in nothing: its lack is chance, and the step stays bounded. [-]"""

MOST_CORRELATED = 0.95
"""Correlation of the volatilities at most: the two stay two. [-]"""

LARGEST_STEP = float(np.log(1.5))
"""By which log amplitudes change at a frequency in one round: a whole step of the fine noise would overshoot where the
coarse movement outweighs it. [-]"""


def with_volatility(
    model: AutoregressiveModel, bands: Sequence[tuple[FloatArray, FloatArray]], population: bool, settings: FitSettings
) -> AutoregressiveModel:
    """Volatilities and their correlation from the excess covariance of log power over that of steady movement.

    From the slow and fast part of each run, shape (n_i,). [lane widths]
    """
    steady = simulate(model, 2000, settings.seed, drivers=64)
    reference = [split_bands(row, settings.step) for row in steady]
    candidates = []
    for which, seconds in ((_wiggle, settings.coarse_window), (itemgetter(1), settings.fine_window)):
        window = round(seconds / settings.step)
        n_lags = max(2, int(MAX_LAG / seconds))
        measured = [log_power(which(pair), window) for pair in bands if len(which(pair)) >= window]
        covariance, counts = autocovariance(measured, n_lags)
        expected, _ = autocovariance([log_power(which(pair), window) for pair in reference], n_lags)
        candidates.append(fit_volatility(covariance - expected, counts, seconds, population=population))
    coarse, fine = (part if part.total > LEAST_VOLATILITY.total else LEAST_VOLATILITY for part in candidates)
    return replace(model, coarse_volatility=coarse, fine_volatility=fine, correlation=0.5)


def simulate(
    model: AutoregressiveModel, n: int, seed: int, *, drivers: int, starts: FloatArray | None = None
) -> FloatArray:
    """Relative offsets of drives of the model, shape (drivers, n), with given first values, shape (drivers,). [-]"""
    start = None if starts is None else Start(starts)
    coarse, fine = model.stream(np.random.SeedSequence(seed), start, drivers=drivers).take(n)
    return np.ascontiguousarray((coarse + fine).T)


def _wiggle(pair: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Second difference of the slow part over a second: coarse movement without its slow drift."""
    slow, every = pair[0], COARSE_EVERY
    return np.asarray(slow[2 * every :] - 2.0 * slow[every:-every] + slow[: -2 * every])


def matched(model: AutoregressiveModel, runs: Sequence[FloatArray], settings: FitSettings) -> AutoregressiveModel:
    """Correct scales, volatilities and spectrum until simulated snippets vary as the measured ones do.

    From runs of shape (n_i,) [lane widths], by indirect inference [1]_. Simulated snippets are cut from free runs, as
    the measured ones are: those that begin where the measured ones do are drawn otherwise, which would be taken for a
    lack.
    """
    length = round(settings.snippet / settings.step) + 1
    real = np.concatenate(
        [run[: len(run) // length * length].reshape(-1, length) for run in runs if len(run) >= length]
    )
    target, window = _moments(real), window_of(runs, settings.compared_windows, settings)
    spectrum = _log_spectrum(runs, window)
    many = min(max(FOR_EACH * len(real) // SNIPPETS_EACH, SIMULATED_DRIVERS), MOST_SIMULATED)
    slopes: FloatArray | None = None
    for left in reversed(range(settings.rounds)):
        simulated = _drives_of(
            model, length, settings.seed, round(settings.effort * (SIMULATED_DRIVERS if left else many))
        )
        lacks, moments = spectrum - _log_spectrum([simulated], window), _moments(simulated.reshape(-1, length))
        if slopes is None:
            nudged = _drives_of(_volatile(model, VARIANCE_NUDGE, VARIANCE_NUDGE), length, settings.seed, len(simulated))
            slopes = _asked(_moments(nudged.reshape(-1, length)) - moments) / VARIANCE_NUDGE
        fine = replace(model.fine, damping=model.fine.damping * _gain(model, lacks))
        scale, model = model.coarse.scale, _corrected(model, target - moments, slopes, settings)
        still = lacks - 2.0 * np.log(model.coarse.scale / scale)  # lacking after the coarse movement was scaled
        model = replace(model, coarse=scaled_spectrum(model.coarse, _coarse_gain(still, settings)), fine=fine)
    return model


def _drives_of(model: AutoregressiveModel, length: int, seed: int, drivers: int) -> FloatArray:
    """Free runs as long as several snippets, each by its own driver, shape (n, length of a run). [lane widths]"""
    parts = [
        simulate(model, SNIPPETS_EACH * length, seed + first, drivers=min(SIMULATED_DRIVERS, drivers - first))
        for first in range(0, drivers, SIMULATED_DRIVERS)
    ]
    return np.concatenate(parts)


def _log_spectrum(runs: Sequence[FloatArray], window: int) -> FloatArray:
    """Mean log power of windows at their own frequencies from 0 on, straight line from end to end taken out.

    Of runs of shape (n,), or stacks of equally long ones, shape (k, n). [lane widths]
    """
    powers = [periodograms(run, window, detrend=Detrend.ENDS) for run in runs]
    return np.asarray(np.log(np.concatenate(powers) + 1e-30).mean(axis=0))


def _gain(model: AutoregressiveModel, lacks: FloatArray) -> FloatArray:
    """Factor on the damping at its knots from what the log spectrum of snippets lacks; knots without noise stay so."""
    return _raised(lacks, np.linspace(0.0, 0.5, len(model.fine.damping)), np.ones(len(model.fine.damping)))


def _coarse_gain(lacks: FloatArray, settings: FitSettings) -> FloatArray:
    """Factor on the coarse movement's amplitude at `FREQUENCIES`, from what the log spectrum of snippets lacks.

    Where the fine noise could be and is not: from its slowest on up to the border, and a knot beyond. What is slower,
    the covariances of whole runs have: typical windows of a driver who drifts calmly and returns briskly lack it.
    """
    at = FREQUENCIES / COARSE_EVERY
    hertz, between = at / settings.step, 0.5 / settings.step / (settings.n_knots - 1)
    share = rise(hertz, settings) * np.interp(hertz, [BORDER, BORDER + between], [1.0, 0.0])
    return _raised(lacks, at, share)


def _raised(lacks: FloatArray, frequency: FloatArray, share: FloatArray) -> FloatArray:
    """Factor on the amplitude by the log power that lacks evenly from 0 to 0.5 cycles per sample, shape of `frequency`.

    `share` of it is to be made up for there. [-]
    """
    known = np.interp(frequency, np.linspace(0.0, 0.5, len(lacks)), lacks)
    return np.asarray(np.exp(np.clip(0.5 * share * known, -LARGEST_STEP, LARGEST_STEP)))


def _moments(snippets: FloatArray) -> FloatArray:
    """What snippets are compared by, from the logarithms of three standard deviations of each.

    Mean and variance of that of the offset (spread), of its first difference (speed) and of its second difference
    (roughness), and the covariance of spread and roughness.
    """
    spread, speed, rough = (np.log(np.diff(snippets, k, axis=1).std(axis=1) + 1e-12) for k in range(3))
    spreads = (part for series in (spread, speed, rough) for part in (series.mean(), series.var()))
    return np.array([*spreads, np.mean((spread - spread.mean()) * (rough - rough.mean()))])


def _asked(lacks: FloatArray) -> FloatArray:
    """What is asked of both volatilities' variances: spread and speed differ, and meet half-way. Shape (2,). [-]"""
    _, spread, _, speed, _, rough, _ = lacks
    return np.array([0.5 * (spread + speed), rough])


def _volatile(model: AutoregressiveModel, coarse: float, fine: float) -> AutoregressiveModel:
    """The model with the log variance of either volatility moved. [-]"""
    return replace(
        model,
        coarse_volatility=model.coarse_volatility.scaled(float(np.exp(coarse))),
        fine_volatility=model.fine_volatility.scaled(float(np.exp(fine))),
    )


def _corrected(
    model: AutoregressiveModel, lacks: FloatArray, slopes: FloatArray, settings: FitSettings
) -> AutoregressiveModel:
    """The model with each parameter moved against what its moment lacks; `slopes` of what is asked, shape (2,)."""
    larger = float(np.exp(0.5 * (lacks[0] + lacks[2])))
    coarse, fine = np.clip(_asked(lacks) / np.maximum(slopes, LEAST_SLOPE), -VARIANCE_NUDGE, VARIANCE_NUDGE).tolist()
    shown = [part.over(settings.snippet) for part in (model.coarse_volatility, model.fine_volatility)]
    correlation = model.correlation + lacks[6] / max(np.sqrt(shown[0] * shown[1]), LEAST_SLOPE)
    return replace(
        _volatile(model, coarse, fine),
        coarse=Autoregression(model.coarse.coefficients, model.coarse.scale * larger),
        correlation=float(np.clip(correlation, 0.0, MOST_CORRELATED)),
    )


CORRELATION_TIMES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0)
"""Of the part that varies within seconds, as tried; one value a second can't hold shorter ones. [s]"""

MAX_LAG = 60.0
"""Longest lag that is fitted. [s]"""


def log_power(values: FloatArray, window: int) -> FloatArray:
    """Half the logarithm [-] of the mean square in successive windows, shape (len(values) // window,)."""
    count = len(values) // window
    power = (values[: count * window].reshape(count, window) ** 2).mean(axis=1)
    return np.asarray(0.5 * np.log(np.maximum(power, 1e-30)))


def autocovariance(series: Sequence[FloatArray], n_lags: int) -> tuple[FloatArray, FloatArray]:
    """Covariance [square of the unit] of windows so many apart, about the common mean, and its count of pairs.

    Series of shape (n_i,) give arrays of shape (n_lags,) each.
    """
    mean = float(np.concatenate(series).mean())
    sums, counts = np.zeros(n_lags), np.zeros(n_lags)
    for values in series:
        about = values - mean
        for lag in range(min(n_lags, len(about))):
            sums[lag] += about[: len(about) - lag] @ about[lag:]
            counts[lag] += len(about) - lag
    return sums / np.maximum(counts, 1.0), counts


def fit_volatility(excess: FloatArray, counts: FloatArray, seconds: float, *, population: bool) -> Volatility:
    """Fit to the excess covariance of log power over what steady Gaussian movement would show.

    `excess` and its weights, shape (n_lags,), at lags of 0, 1, 2 ... windows of so many seconds [s]. In a population of
    several drivers what lasts is a difference between them, else slow variation.
    """
    best, least = Volatility(), np.inf
    weights = np.sqrt(counts / max(counts.max(), 1.0))
    for time in CORRELATION_TIMES:
        shape = averaged_covariance(len(excess), seconds, time)
        for basis in ([shape, np.ones(len(excess))], [shape]):
            columns = np.stack(basis, axis=1)
            shares = np.linalg.lstsq(columns * weights[:, None], excess * weights, rcond=None)[0]
            if (shares < 0).any():
                continue
            error = float((((columns @ shares - excess) * weights) ** 2).sum())
            if error < least - 1e-12:
                lasting = float(shares[1]) if len(shares) > 1 else 0.0
                best, least = Volatility(lasting, float(shares[0]), time), error
            break
    return best if population else Volatility(0.0, best.within, best.correlation_time, best.between)
