"""Effects that a test plants in a simulated drive: on what the driver wants or is able to do, or on the camera.

A plant is small and frozen; `apply` changes the driver's `Intent`, which the steering loop then follows with all its
lags, thresholds and noise: what ends up in the recorded offset is the driver's doing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from xosc_lateral.datasets.motorway import STEP

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
    """As it is."""
    return quantity


def saturating(scale: float) -> Shape:
    """Linear for small values, levelling off beyond `scale`."""
    return lambda quantity: np.tanh(quantity / scale) * scale


def threshold(at: float) -> Shape:
    """Nothing below `at`, everything above."""
    return lambda quantity: (quantity > at).astype(float)


@dataclass(frozen=True)
class Response:
    """How a driver answers to a quantity: of what shape, how early, how slowly.

    Parameters
    ----------
    shape : callable
        Applied to the product of the columns: `linear`, `saturating(scale)`, `threshold(at)` or your own.
    look_ahead : float
        The driver answers to what will be so much later. [s]
    lag : float
        First-order lag of the answer. [s]
    """

    shape: Shape = linear
    look_ahead: float = 0.0
    lag: float = 0.0

    def scaled(self, quantity: np.ndarray) -> np.ndarray:
        """Answer, scaled so that it changes by 1 between the 5 % and 95 % quantile of itself, about its median."""
        shaped = self.shape(np.nan_to_num(quantity, nan=float(np.nanmax(quantity))))
        low, middle, high = np.quantile(shaped, [0.05, 0.5, 0.95])
        if high <= low:  # an on/off quantity that is on for less than 5 % of the time
            low, middle, high = shaped.min(), shaped.min(), shaped.max()
        unit = (shaped - middle) / (high - low) if high > low else np.zeros_like(shaped)
        ahead = round(self.look_ahead / STEP)
        unit = np.concatenate([unit[ahead:], np.full(ahead, unit[-1])]) if ahead else unit
        return _lagged(unit, self.lag)


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
    response: Response = field(default_factory=Response)
    kind: str = "location"

    def quantity(self, context: Context) -> np.ndarray:
        """What the driver answers to."""
        product = np.ones_like(context["speed"])
        for column in self.columns:
            product = product * context[column]
        return product

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Move the target."""
        intent.target += self.size * self.response.scaled(self.quantity(context))


def curve_cutting(size: float = 0.25, look_ahead: float = 1.2, lag: float = 0.0) -> ShiftBy:
    """To the inside of the curve, before it begins: to the left where curvature is positive."""
    return ShiftBy(("curvature",), size, Response(look_ahead=look_ahead, lag=lag))


def truck_avoidance(size: float = 0.25, lag: float = 1.0) -> ShiftBy:
    """To the left while a truck drives alongside on the right."""
    return ShiftBy(("truck_right",), size, Response(lag=lag))


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
        intent.target += self.size * Response(lag=self.lag).scaled(cross)


@dataclass(frozen=True)
class LaneHabit:
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
        intent.target += _lagged(np.asarray(self.offsets)[context["lane_index"].astype(int)], 1.0)


@dataclass(frozen=True)
class SpreadBy:
    """The driver is more or less careful, depending on a column: tolerance and inexactness together.

    Parameters
    ----------
    column : str
        Where it is NaN (no car ahead), the largest value counts.
    factor : float
        Spread at the 95 % quantile over the spread at the 5 % quantile. [-]
    """

    column: str
    factor: float
    response: Response = field(default_factory=lambda: Response(lag=1.0))
    kind: str = "scale"

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Widen or narrow the tolerance."""
        factor = self.factor ** self.response.scaled(context[self.column])
        intent.tolerance *= factor
        intent.noise *= factor


@dataclass(frozen=True)
class RestoringBy:
    """One correction takes away more or less of a noticed error, depending on a column.

    Parameters
    ----------
    factor : float
        Share at the 95 % quantile over the share at the 5 % quantile. [-]
    """

    column: str
    factor: float
    response: Response = field(default_factory=Response)
    kind: str = "dynamics"

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Strengthen or weaken the corrections."""
        intent.gain *= self.factor ** self.response.scaled(context[self.column])


@dataclass(frozen=True)
class ShakyCamera:
    """The camera reads less exactly where a column is high: fine noise, and no movement of the car.

    Parameters
    ----------
    column : str
    size : float
        Standard deviation of the error at the 95 % quantile less that at the 5 % quantile; none at the smallest. [m]
    memory : float
        Correlation time of the error. [s]
    """

    column: str
    size: float = 0.04
    memory: float = 0.3
    kind: str = "scale"

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Blur the measurement."""
        strength = Response().scaled(context[self.column])
        keep = np.exp(-STEP / self.memory)
        error = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=len(strength)))
        intent.camera += self.size * (strength - strength.min()) * error


@dataclass(frozen=True)
class Fatigue:
    """Spread grows steadily from the beginning to the end of the drive, by this factor. [-]"""

    factor: float = 2.0
    kind: str = "scale"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Widen tolerance and inexactness with time."""
        factor = self.factor ** (np.linspace(0.0, 1.0, len(intent.target)) - 0.5)
        intent.tolerance *= factor
        intent.noise *= factor


@dataclass(frozen=True)
class TargetWander:
    """What the driver holds for the middle wanders slowly.

    Parameters
    ----------
    size : float
        Standard deviation of the target. [m]
    time_constant : float
        Correlation time. [s]
    """

    size: float = 0.2
    time_constant: float = 400.0
    kind: str = "drift"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Move the target."""
        n = len(intent.target)
        keep = np.exp(-STEP / self.time_constant)
        walk = lfilter([1.0], [1.0, -keep], rng.normal(size=n))
        intent.target += self.size * (walk - walk.mean()) / walk.std()


@dataclass(frozen=True)
class Weave:
    """The driver weaves: the target swings with a period.

    Parameters
    ----------
    amplitude : float
        [m]
    period : float
        [s]
    """

    amplitude: float = 0.15
    period: float = 12.0
    kind: str = "periodic"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Swing the target."""
        time = STEP * np.arange(len(intent.target))
        intent.target += self.amplitude * np.sin(2.0 * np.pi * (time / self.period + rng.random()))


@dataclass(frozen=True)
class Distraction:
    """Regimes: at times the driver looks away for seconds on end, and corrects late and carelessly.

    Parameters
    ----------
    share : float
        Of the time. [-]
    length : float
        Mean length of a regime. [s]
    tolerance : float
        Factor on the tolerance in it. [-]
    """

    share: float = 0.3
    length: float = 40.0
    tolerance: float = 2.2
    kind: str = "regime"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Widen the tolerance, and look away for a second again and again."""
        n, start = len(intent.target), 0
        on = rng.random() < self.share
        while start < n:
            mean = self.length if on else self.length * (1.0 - self.share) / self.share
            stop = start + max(1, round(rng.exponential(mean) / STEP))
            if on:
                intent.tolerance[start:stop] *= self.tolerance
                intent.noise[start:stop] *= 1.0 + 0.6 * (self.tolerance - 1.0)
                glance = np.arange(min(stop, n) - start) * STEP
                intent.attention[start:stop] = np.mod(glance, 3.0) > 0.9
            start, on = stop, not on


@dataclass(frozen=True)
class CameraStep:
    """The camera is recalibrated: from `at` (share of the drive) on, it reads `size` [m] more to the left."""

    size: float = 0.25
    at: float = 0.45
    kind: str = "step"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Shift the measurement, not the car."""
        intent.camera[round(self.at * len(intent.camera)) :] += self.size


@dataclass(frozen=True)
class SensorDrift:
    """The camera drifts steadily by `size` [m] over the drive."""

    size: float = 0.3
    kind: str = "drift"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Shift the measurement, not the car."""
        intent.camera += self.size * (np.linspace(0.0, 1.0, len(intent.camera)) - 0.5)


@dataclass(frozen=True)
class Companion:
    """No effect: a further column that is correlated with another one and causes nothing.

    Parameters
    ----------
    of : str
        The column that it accompanies.
    name : str
        What it is called in the table.
    correlation : float
        With `of`. [-]
    time_constant : float
        Correlation time of its own part. [s]
    """

    of: str
    name: str = "companion"
    correlation: float = 0.9
    time_constant: float = 20.0
    kind: str = "none"
    columns: tuple[str, ...] = ()

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Add the column."""
        source = np.nan_to_num(context[self.of], nan=float(np.nanmax(context[self.of])))
        own = lfilter([1.0], [1.0, -np.exp(-STEP / self.time_constant)], rng.normal(size=len(source)))
        unit = (source - source.mean()) / source.std()
        own = (own - own.mean()) / own.std()
        context[self.name] = self.correlation * unit + np.sqrt(1.0 - self.correlation**2) * own


def _lagged(values: np.ndarray, time_constant: float) -> np.ndarray:
    if time_constant <= 0.0:
        return values
    keep = np.exp(-STEP / time_constant)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])
