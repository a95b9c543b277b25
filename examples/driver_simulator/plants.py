"""What a simulated driver answers to, and how: shapes of answers, and effects that are planted in the driver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .motorway import STEP, first_order

Context = dict[str, np.ndarray]


@dataclass(eq=False)
class Intent:
    """What the driver wants at every step, and what the camera does to the record; shape (n,) each."""

    target: np.ndarray
    """Offset aimed at, left positive. [m]"""
    tolerance: np.ndarray
    """Factor on the error that the driver lets pass. [-]"""
    gain: np.ndarray
    """Factor on the share of a noticed error that one correction takes away. [-]"""
    noise: np.ndarray
    """Factor on what hand and eye do inexactly. [-]"""
    attention: np.ndarray
    """1 where the driver watches the road, 0 where not. [-]"""
    camera: np.ndarray
    """Added to the measured offset: an error of the sensor. [m]"""

    @classmethod
    def neutral(cls, n: int) -> Intent:
        """A driver without any effect."""
        return cls(np.zeros(n), np.ones(n), np.ones(n), np.ones(n), np.ones(n), np.zeros(n))


class Plant(Protocol):
    """One effect."""

    @property
    def kind(self) -> str:
        """Kind of finding that names it (DESIGN, section 6)."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that cause it; empty for a hidden effect."""
        ...

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Change what the driver does; a plant may also add a column to the context."""
        ...


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
