"""Autoregressive models with round numbers."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression, Volatility
from xosc_lateral.drivers.model.core.base import ShapedNoise

DAMPING = np.concatenate([np.zeros(5), np.linspace(0.02, 0.001, 46)])

POPULATION = AutoregressiveModel(
    mean=-0.02,
    between_drivers=0.04,
    coarse=Autoregression(np.array([1.5, -0.62]), 0.012),
    fine=ShapedNoise(DAMPING, 71, 5.0),
    coarse_volatility=Volatility(0.05, 0.10, 4.0),
    fine_volatility=Volatility(0.08, 0.20, 3.0),
    correlation=0.5,
    limits=(-0.45, 0.40),
)
"""Drivers that differ, and whose volatility varies."""

STEADY = replace(
    POPULATION,
    between_drivers=0.0,
    coarse_volatility=Volatility(),
    fine_volatility=Volatility(),
)
"""One driver, always as volatile."""
