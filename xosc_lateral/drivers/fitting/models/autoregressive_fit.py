"""Fitting our model. First what can be read off the data, then a few rounds of simulating and comparing.

1. Mean of all.
2. Coarse movement and the variance between drivers (`fit_coarse`).
3. Fine noise: what the coarse movement lacks of the offset's power spectrum, geometric mean over windows.
4. Volatility: how much more, and for how long, the power in short windows varies than it would in steady movement.
5. Rounds of simulating: snippets of the model from the measured snippets' starts must show the same moments of log
   standard deviation, of the offset and of its differences. What differs corrects the scales, the volatilities and
   their correlation, and windows of both the spectrum of either part (indirect inference: Gourieroux, Monfort, Renault
   1993).

Everything is deterministic: the simulations draw from a fixed seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace
from numpy.lib.stride_tricks import sliding_window_view

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.numbers import all_significant, significant
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import (
    DEFAULT_SETTINGS,
    FitSettings,
    fit_coarse,
    fit_spectrum,
)
from xosc_lateral.drivers.fitting.models.autoregressive_matching import matched, with_volatility
from xosc_lateral.drivers.model.core.autoregressive.coarse import FREQUENCIES, Autoregression, largest_root, split_bands
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import Volatility

DIGITS = 5
"""Significant digits kept of a fitted number: a hundredth of its standard error and less. What another processor gives
differs by up to a hundred millionth (linear algebra in another order), so that one number in 10,000 is rounded to
another last digit there. [-]"""

MAXIMUM_LOG_POWER_CHANGE = 2e-3
"""Largest change of the coarse movement's log power that rounding may make at any frequency: 0.01 dB. Coefficients of
an autoregression nearly add up to one, and what they lack of it decides how far a driver wanders. [-]"""

HELD, HELD_WITHIN, HELD_SHARE = 3.0, 120.0, 0.01
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
    held = sliding_window_view(away, round(HELD / model.step), axis=0).min(axis=-1).max(axis=0)
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
    return rounded(replace(model, limits=_limits(everything, mean, _held_reach(model, settings))))
