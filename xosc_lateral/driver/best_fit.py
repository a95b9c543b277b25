"""Fitting our model. First what can be read off the data, then a few rounds of simulating and comparing.

1. Mean, and the variance between drivers: the covariance that is left between moments far apart in a run.
2. Coarse movement: autoregression on the low-passed offset about the driver's (shrunken) mean, all moments of a driver
   counting the same.
3. Fine noise: what the coarse movement lacks of the offset's power spectrum, geometric mean over windows.
4. Liveliness: how much more, and for how long, the power in short windows varies than it would in steady movement.
5. Rounds of simulating: snippets of the model from the measured snippets' starts must show the same moments of log
   standard deviation, of the offset and of its differences. What differs corrects the scales, the livelinesses and
   their correlation (indirect inference: Gourieroux, Monfort, Renault 1993).

Everything is deterministic: the simulations draw from a fixed seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.autoregression import Autoregression, fit_autoregression
from xosc_lateral.driver.bands import COARSE_EVERY, building_low_pass, split_bands
from xosc_lateral.driver.best import BestModel
from xosc_lateral.driver.best_batch import sample_batch
from xosc_lateral.driver.liveliness import MAX_LAG, Liveliness, autocovariance, fit_liveliness, log_power
from xosc_lateral.driver.noise import NOISE_VARIANCE, ShapedNoise
from xosc_lateral.driver.series import STEP
from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BestSettings:
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
    fine_window, coarse_window : float
        Windows that liveliness is seen by. [s]
    far : tuple of float
        Two moments are far apart when this share of the typical run (by time) is between them, up to `farthest`.
    farthest : float
        [s]
    snippet : float
        Length of the simulated snippets. [s]
    n_snippets : int
        Simulated at least, in each round.
    pace_weight : float
        The coarse scale is corrected by what snippets lack in pace with this weight, by what in spread with the rest.
    rounds : int
    coarse_gain, fine_gain : float
        How far a round corrects the variance of a liveliness, per missing variance of what is compared: the fine
        part's moods are shorter than a snippet, which shows a fraction of their variance.
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
    fine_window: float = 2.0
    coarse_window: float = 5.0
    far: tuple[float, float] = (0.5, 1.0)
    farthest: float = 120.0
    snippet: float = 10.0
    n_snippets: int = 2000
    pace_weight: float = 0.7
    rounds: int = 8
    coarse_gain: float = 1.0
    fine_gain: float = 3.0
    seed: int = 20240517
    step: float = STEP


DEFAULT_SETTINGS = BestSettings()


def fit_best(
    rel_offsets: Sequence[FloatArray], drives: Sequence[str], settings: BestSettings = DEFAULT_SETTINGS
) -> BestModel:
    """Fit to relative offsets, one array per run at 5 Hz; runs of one drive are of one driver.

    Raises
    ------
    NotEnoughDataError
        When no run lasts one snippet, or the offset never moves.
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
    mean, between = _drivers(runs, drives, settings)
    bands = [split_bands(run, settings.step) for run in runs]
    coarse = _fit_coarse([slow for slow, _ in bands], _shrunken_means(runs, drives, mean, between), drives, settings)
    coarse, fine = _fit_spectrum(runs, coarse, settings)
    low, high = max(-0.5, float(everything.min())), min(0.5, float(everything.max()))
    model = BestModel(
        mean=mean,
        between_drivers=float(np.sqrt(between)),
        coarse=coarse,
        fine=fine,
        coarse_liveliness=Liveliness(),
        fine_liveliness=Liveliness(),
        correlation=0.0,
        limits=(min(low, mean - 1e-3), max(high, mean + 1e-3)),
        step=settings.step,
    )
    model = _with_liveliness(model, bands, len(set(drives)) > 1, settings)
    return _rounded(_matched(model, runs, settings))


def _drivers(runs: Sequence[FloatArray], drives: Sequence[str], settings: BestSettings) -> tuple[float, float]:
    """Mean of all, and variance of the drivers' means: covariance of moments far apart in one run. [-]"""
    lengths = np.array([len(run) for run in runs])
    mean = float(np.concatenate(runs).mean())
    count = len(set(drives))
    if count < 2:
        return mean, 0.0
    order = np.argsort(lengths)
    typical = lengths[order][np.searchsorted(np.cumsum(lengths[order]), 0.5 * lengths.sum())]
    reach = min(float(typical), settings.farthest / settings.step)
    lags = range(int(settings.far[0] * reach), int(settings.far[1] * reach), COARSE_EVERY)
    total, pairs = 0.0, 0
    for run in runs:
        about = run - mean
        for lag in lags:
            if len(about) > lag:
                total += float(about[lag:] @ about[: len(about) - lag])
                pairs += len(about) - lag
    variance = float(np.concatenate(runs).var())
    # The common mean was taken out, and with it a part of the differences between a few drivers.
    return mean, float(np.clip(total / max(pairs, 1) * count / (count - 1), 0.0, 0.9 * variance))


def _shrunken_means(runs: Sequence[FloatArray], drives: Sequence[str], mean: float, between: float) -> list[float]:
    """For each run its driver's mean, drawn towards the common one by as little as its data say. [-]"""
    within = max(float(np.concatenate(runs).var()) - between, 1e-12)
    sums: dict[str, tuple[float, int]] = {}
    for run, drive in zip(runs, drives, strict=True):
        total, count = sums.get(drive, (0.0, 0))
        sums[drive] = (total + float((run - mean).sum()), count + len(run))
    means = {}
    for drive, (total, count) in sums.items():
        independent = max(1.0, count * STEP / INDEPENDENT_AFTER)
        means[drive] = mean + total / count * between / (between + within / independent)
    return [means[drive] for drive in drives]


INDEPENDENT_AFTER = 12.0
"""Two offsets of a driver this far apart count as independent when a mean's precision is judged. [s]"""


def _fit_coarse(
    slow: Sequence[FloatArray], means: Sequence[float], drives: Sequence[str], settings: BestSettings
) -> Autoregression:
    longest = max(map(len, slow)) * settings.step
    order = max(2, min(settings.order, int(0.4 * longest * settings.step * COARSE_EVERY)))
    about = [values - mean for values, mean in zip(slow, means, strict=True)]
    return fit_autoregression(about, order, every=COARSE_EVERY, drivers=drives)


def _fit_spectrum(
    runs: Sequence[FloatArray], coarse: Autoregression, settings: BestSettings
) -> tuple[Autoregression, ShapedNoise]:
    """Scale of the coarse movement, and fine noise that has what the coarse lacks of the measured power."""
    frequency, power = _typical_power(runs, settings)
    knots = np.linspace(0.0, 0.5, settings.n_knots)  # in cycles per sample
    kernel = building_low_pass()
    gain = np.abs(np.exp(-2j * np.pi * np.outer(knots, np.arange(len(kernel)))) @ kernel)
    coarse_power = coarse.power(knots * COARSE_EVERY) * gain**2 / COARSE_EVERY
    measured = np.exp(np.interp(knots, frequency, np.log(power)))
    hertz = knots / settings.step
    shared = (hertz >= settings.scale_band[0]) & (hertz <= settings.scale_band[1])
    scale = float(np.exp(np.log(measured[shared] / coarse_power[shared]).mean()))
    lacking = np.maximum(measured - scale * coarse_power, 0.0)
    low, high = settings.fine_from
    rise = np.sin(0.5 * np.pi * np.clip((hertz - low) / (high - low), 0.0, 1.0)) ** 2
    noise = _shaped(np.sqrt(lacking / NOISE_VARIANCE) * rise, settings)
    return replace(coarse, scale=coarse.scale * np.sqrt(scale)), noise


def _shaped(wanted: FloatArray, settings: BestSettings) -> ShapedNoise:
    """Noise whose kernel has the wanted gain at the knots, although it is short and faded out."""
    half = settings.n_taps // 2
    knots = np.linspace(0.0, 0.5, len(wanted))
    waves = np.cos(2.0 * np.pi * np.outer(knots, np.arange(-half, half + 1)))
    noise = ShapedNoise(wanted, settings.n_taps, settings.taper)
    for _ in range(GAIN_ROUNDS):
        gain = np.abs(waves @ noise.kernel)
        ratio = np.where(wanted > 0.0, wanted / np.maximum(gain, 1e-30), 1.0)
        noise = replace(noise, damping=noise.damping * np.clip(ratio, 0.5, 2.0))
    return noise


def _typical_power(runs: Sequence[FloatArray], settings: BestSettings) -> tuple[FloatArray, FloatArray]:
    """Power spectrum of steady movement: geometric means over windows, so that lively ones don't outweigh the others.

    (A periodogram's logarithm lies on average Euler's constant below that of the power.)

    Returns
    -------
    frequency, power : array
        In cycles per sample, and with white noise of variance 1 at 1 everywhere.
    """
    for seconds in settings.spectrum_windows:
        size = round(seconds / settings.step)
        if sum(len(run) // size for run in runs) >= 20:
            break
    size = min(size, max(map(len, runs)))
    taper = np.hanning(size + 2)[1:-1]
    taper /= np.sqrt((taper**2).sum())
    powers = []
    for run in runs:
        if len(run) >= size:
            pieces = np.lib.stride_tricks.sliding_window_view(run, size)[:: size // 2]
            slope = np.linspace(0.0, 1.0, size) * (pieces[:, -1:] - pieces[:, :1])
            powers.append(np.abs(np.fft.rfft((pieces - pieces[:, :1] - slope) * taper, axis=1)) ** 2)
    power = np.concatenate(powers)
    frequency = np.fft.rfftfreq(size)
    typical = np.exp(np.log(power + 1e-30).mean(axis=0) + np.euler_gamma)
    return np.asarray(frequency, dtype=np.float64), np.asarray(typical)


def _with_liveliness(
    model: BestModel, bands: Sequence[tuple[FloatArray, FloatArray]], population: bool, settings: BestSettings
) -> BestModel:
    """Livelinesses and their correlation from the excess covariance of log power over that of steady movement."""
    steady = sample_batch(model, np.zeros(64), 2000, np.random.default_rng(settings.seed), start=False)
    reference = [split_bands(row, settings.step) for row in steady]
    found = []
    for which, seconds in ((_wiggle, settings.coarse_window), (_fine_of, settings.fine_window)):
        window = round(seconds / settings.step)
        n_lags = max(2, int(MAX_LAG / seconds))
        measured = [log_power(which(pair), window) for pair in bands if len(which(pair)) >= window]
        covariance, counts = autocovariance(measured, n_lags)
        expected, _ = autocovariance([log_power(which(pair), window) for pair in reference], n_lags)
        found.append(fit_liveliness(covariance - expected, counts, seconds, population=population))
    floor = Liveliness(0.0, 1e-3, 10.0)
    coarse, fine = (part if part.total > floor.total else floor for part in found)
    return replace(model, coarse_liveliness=coarse, fine_liveliness=fine, correlation=0.5)


def _wiggle(pair: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Second difference of the slow part over a second: coarse movement without its slow wander."""
    slow, every = pair[0], COARSE_EVERY
    return np.asarray(slow[2 * every :] - 2.0 * slow[every:-every] + slow[: -2 * every])


def _fine_of(pair: tuple[FloatArray, FloatArray]) -> FloatArray:
    return pair[1]


def _matched(model: BestModel, runs: Sequence[FloatArray], settings: BestSettings) -> BestModel:
    """Correct scales and livelinesses until simulated snippets vary as the measured ones do."""
    length = round(settings.snippet / settings.step) + 1
    real = np.concatenate(
        [run[: len(run) // length * length].reshape(-1, length) for run in runs if len(run) >= length]
    )
    starts = np.resize(real[:, 0], max(settings.n_snippets, len(real)))
    target = _moments(real)
    for _ in range(settings.rounds):
        simulated = sample_batch(model, starts, length, np.random.default_rng(settings.seed), start=True)
        model = _corrected(model, target - _moments(simulated), settings)
    return model


def _moments(snippets: FloatArray) -> FloatArray:
    """What snippets are compared by, from the logarithms of three standard deviations of each.

    Mean and variance of that of the offset (spread), of its first difference (pace) and of its second difference
    (roughness), and the covariance of spread and roughness.
    """
    spread, pace, rough = (np.log(np.diff(snippets, k, axis=1).std(axis=1) + 1e-12) for k in range(3))
    spreads = (part for series in (spread, pace, rough) for part in (series.mean(), series.var()))
    return np.array([*spreads, np.mean((spread - spread.mean()) * (rough - rough.mean()))])


def _corrected(model: BestModel, lacks: FloatArray, settings: BestSettings) -> BestModel:
    """The model with each parameter moved against what its moment lacks."""
    coarse, fine = model.coarse_liveliness, model.fine_liveliness
    spread_mean, spread_variance, pace_mean, pace_variance, rough_mean, rough_variance, covariance = lacks
    larger = np.exp((1.0 - settings.pace_weight) * spread_mean + settings.pace_weight * pace_mean)
    # Calm and lively snippets differ in spread and in pace; one variance has to serve both, so it meets them half-way.
    factors = [
        float(np.clip(1.0 + gain * lack / max(part.total, 0.02), 0.5, 2.0))
        for gain, lack, part in (
            (settings.coarse_gain, 0.5 * (spread_variance + pace_variance), coarse),
            (settings.fine_gain, rough_variance, fine),
        )
    ]
    both = max(np.sqrt(coarse.total * fine.total), 0.02)
    return replace(
        model,
        coarse=Autoregression(model.coarse.coefficients, model.coarse.scale * float(larger)),
        fine=replace(model.fine, damping=model.fine.damping * float(np.exp(rough_mean))),
        coarse_liveliness=coarse.scaled(factors[0]),
        fine_liveliness=fine.scaled(factors[1]),
        correlation=float(np.clip(model.correlation + covariance / both, 0.0, 0.95)),
    )


GAIN_ROUNDS = 20
"""Rounds in which the damping is corrected for what the kernel's window does to it. [-]"""

DIGITS = 9
"""Significant digits kept of a fitted number: what differs beyond is the processor's rounding. [-]"""


def _rounded(model: BestModel) -> BestModel:
    def tidy(value: float) -> float:
        return float(f"{value:.{DIGITS}g}")

    def tidy_all(values: FloatArray) -> FloatArray:
        return np.array([tidy(value) for value in values])

    def tidy_part(part: Liveliness) -> Liveliness:
        return Liveliness(tidy(part.between), tidy(part.within), tidy(part.memory), tidy(part.slow))

    return BestModel(
        mean=tidy(model.mean),
        between_drivers=tidy(model.between_drivers),
        coarse=Autoregression(tidy_all(model.coarse.coefficients), tidy(model.coarse.scale)),
        fine=replace(model.fine, damping=tidy_all(model.fine.damping)),
        coarse_liveliness=tidy_part(model.coarse_liveliness),
        fine_liveliness=tidy_part(model.fine_liveliness),
        correlation=tidy(model.correlation),
        limits=(tidy(model.limits[0]), tidy(model.limits[1])),
        step=model.step,
    )
