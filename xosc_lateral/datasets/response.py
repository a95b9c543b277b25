"""How a simulated driver responds to a column: of what shape, how early, how slowly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from xosc_lateral.datasets.motorway import STEP
from xosc_lateral.drives.filters import first_order

Shape = Callable[[np.ndarray], np.ndarray]


def linear(quantity: np.ndarray) -> np.ndarray:
    """As it is. Shape (n,). [unit of the quantity]"""
    return quantity


def saturating(scale: float) -> Shape:
    """Linear for small values, levelling off beyond `scale`. [unit of the quantity]"""
    return lambda quantity: np.tanh(quantity / scale) * scale


def threshold(at: float) -> Shape:
    """Nothing below `at`, everything above. [unit of the quantity]"""
    return lambda quantity: (quantity > at).astype(float)


@dataclass(frozen=True)
class SimulatedResponse:
    """How a driver responds to a quantity: of what shape, how early, how slowly.

    Parameters
    ----------
    shape : callable
        Applied to the product of the columns: `linear`, `saturating(scale)`, `threshold(at)` or your own.
    look_ahead : float
        The driver responds to what will be so much later. [s]
    lag : float
        First-order lag of the response. [s]
    """

    shape: Shape = linear
    look_ahead: float = 0.0
    lag: float = 0.0

    def scaled(self, quantity: np.ndarray) -> np.ndarray:
        """Response, scaled so that it changes by 1 between the 5 % and 95 % quantile of itself, about its median.

        Shape (n,). [-]
        """
        shaped = self.shape(np.nan_to_num(quantity, nan=float(np.nanmax(quantity))))
        low, middle, high = np.quantile(shaped, [0.05, 0.5, 0.95])
        if high <= low:  # an on/off quantity that is on for less than 5 % of the time
            low, middle, high = shaped.min(), shaped.min(), shaped.max()
        unit = (shaped - middle) / (high - low) if high > low else np.zeros_like(shaped)
        ahead = round(self.look_ahead / STEP)
        unit = np.concatenate([unit[ahead:], np.full(ahead, unit[-1])]) if ahead else unit
        return lagged(unit, self.lag)


def lagged(values: np.ndarray, time_constant: float) -> np.ndarray:
    """First-order lag that begins settled; `time_constant` in s. Shape (n,). [unit of the values]"""
    if time_constant <= 0.0:
        return values
    keep = np.exp(-STEP / time_constant)
    return first_order(values, keep, gain=1.0 - keep, before=values[0])
