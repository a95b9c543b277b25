"""Parameters with as many digits as mean something, so that a profile's file is short and the same everywhere."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.autoregression import Autoregression
from xosc_lateral.driver.models.autoregressive.model import AutoregressiveModel
from xosc_lateral.driver.models.autoregressive.volatility import Volatility

FloatArray = NDArray[np.float64]

DIGITS = 9
"""Significant digits kept of a fitted number: what differs beyond is the processor's rounding. [-]"""


def rounded(model: AutoregressiveModel) -> AutoregressiveModel:
    """The same with every number rounded to `DIGITS`."""
    return AutoregressiveModel(
        mean=_tidy(model.mean),
        between_drivers=_tidy(model.between_drivers),
        coarse=Autoregression(_tidy_all(model.coarse.coefficients), _tidy(model.coarse.scale)),
        fine=replace(model.fine, damping=_tidy_all(model.fine.damping)),
        coarse_volatility=_tidy_volatility(model.coarse_volatility),
        fine_volatility=_tidy_volatility(model.fine_volatility),
        correlation=_tidy(model.correlation),
        limits=(_tidy(model.limits[0]), _tidy(model.limits[1])),
        step=model.step,
    )


def _tidy(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _tidy_all(values: FloatArray) -> FloatArray:
    return np.array([_tidy(value) for value in values])


def _tidy_volatility(part: Volatility) -> Volatility:
    return Volatility(_tidy(part.between), _tidy(part.within), _tidy(part.correlation_time), _tidy(part.slow))
