"""Parameters with as many digits as mean something, so that a profile's file is short and the same everywhere."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from xosc_lateral.digits import all_significant, significant
from xosc_lateral.driver.models.autoregressive.autoregression import FREQUENCIES, Autoregression, largest_root
from xosc_lateral.driver.models.autoregressive.model import AutoregressiveModel
from xosc_lateral.driver.models.autoregressive.volatility import Volatility

DIGITS = 5
"""Significant digits kept of a fitted number: a hundredth of its standard error and less. What another processor gives
differs by up to a hundred millionth (linear algebra in another order), so that one number in 10,000 is rounded to
another last digit there. [-]"""

KEPT = 2e-3
"""Largest change of the coarse movement's log power that rounding may make at any frequency: 0.01 dB. Coefficients of
an autoregression nearly add up to one, and what they lack of it decides how far a driver wanders. [-]"""

MOST_DIGITS = 17
"""That a number has. [-]"""


def rounded(model: AutoregressiveModel) -> AutoregressiveModel:
    """The same with every number rounded to what is kept of it."""
    return AutoregressiveModel(
        mean=_tidy(model.mean),
        between_drivers=_tidy(model.between_drivers),
        coarse=_tidy_coarse(model.coarse),
        fine=replace(model.fine, damping=np.array(all_significant(model.fine.damping, DIGITS))),
        coarse_volatility=_tidy_volatility(model.coarse_volatility),
        fine_volatility=_tidy_volatility(model.fine_volatility),
        correlation=_tidy(model.correlation),
        limits=(_tidy(model.limits[0]), _tidy(model.limits[1])),
        step=model.step,
    )


def _tidy_coarse(coarse: Autoregression) -> Autoregression:
    """With as few digits as keep the spectrum, and with it a stable autoregression stable."""
    power = np.log(coarse.power(FREQUENCIES))
    for digits in range(DIGITS, MOST_DIGITS):
        coefficients, scale = np.array(all_significant(coarse.coefficients, digits)), significant(coarse.scale, digits)
        if largest_root(coefficients) >= 1.0:
            continue
        short = Autoregression(coefficients, scale)
        if np.abs(np.log(short.power(FREQUENCIES)) - power).max() <= KEPT:
            return short
    return coarse


def _tidy(value: float) -> float:
    return significant(value, DIGITS)


def _tidy_volatility(part: Volatility) -> Volatility:
    return Volatility(_tidy(part.between), _tidy(part.within), _tidy(part.correlation_time), _tidy(part.slow))
