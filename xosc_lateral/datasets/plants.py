"""Effects of columns that a test plants in a simulated drive: on where the driver wants to be.

A plant is small and frozen; `apply` changes the driver's `Intent`, which the steering loop then follows with all its
lags, thresholds and noise: what ends up in the recorded offset is the driver's doing. `spread_plants` holds effects on
how exactly he keeps to it, `hidden_plants` those without a column, `camera_plants` those that he has no part in.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from xosc_lateral.datasets.intent import Context, Intent
from xosc_lateral.datasets.response import SimulatedResponse, lagged


@dataclass(frozen=True)
class ShiftBy:
    """The driver aims elsewhere, depending on a column, or on the product of several.

    Parameters
    ----------
    columns : tuple of str
        Columns of the drive table; their product is the driving quantity.
    size : float
        Change of the target between the 5 % and 95 % quantile of the driving quantity; positive: to the left. [m]
    """

    columns: tuple[str, ...]
    size: float
    response: SimulatedResponse = field(default_factory=SimulatedResponse)
    kind: str = "location"

    def quantity(self, context: Context) -> np.ndarray:
        """What the driver responds to. Shape (n,). [unit of the column]"""
        product = np.ones_like(context["speed"])
        for column in self.columns:
            product = product * context[column]
        return product

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Move the target."""
        intent.target += self.size * self.response.scaled(self.quantity(context))


def curve_cutting(size: float = 0.25, look_ahead: float = 1.2, lag: float = 0.0) -> ShiftBy:
    """To the inside of the curve, before it begins: to the left where curvature is positive.

    `size` in [m], `look_ahead` and `lag` in [s].
    """
    return ShiftBy(("curvature",), size, SimulatedResponse(look_ahead=look_ahead, lag=lag))


def truck_avoidance(size: float = 0.25, lag: float = 1.0) -> ShiftBy:
    """To the left while a truck drives alongside on the right. `size` in [m], `lag` in [s]."""
    return ShiftBy(("truck_right",), size, SimulatedResponse(lag=lag))


@dataclass(frozen=True)
class SideWind:
    """Blown downwind: the cross component of the wind, which is the product of two columns."""

    size: float = 0.25
    lag: float = 1.0
    kind: str = "location"
    columns: tuple[str, ...] = ("wind_speed", "wind_direction")

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Move the target; 90 deg blows towards the left of travel."""
        cross = context["wind_speed"] * np.sin(np.radians(context["wind_direction"]))
        intent.target += self.size * SimulatedResponse(lag=self.lag).scaled(cross)


@dataclass(frozen=True)
class LanePreference:
    """A place of its own in every lane.

    Parameters
    ----------
    offsets : tuple of float
        Target in lane 0 (rightmost), 1, 2. [m]
    """

    offsets: tuple[float, float, float] = (0.15, 0.0, -0.15)
    kind: str = "location"
    columns: tuple[str, ...] = ("lane_index",)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Move the target; smooth over two seconds, as a lane change is."""
        intent.target += lagged(np.asarray(self.offsets)[context["lane_index"].astype(int)], 1.0)
