"""Planted effects on the camera: what it measures is not where the vehicle is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from examples.driver_simulator.motorway import STEP, first_order
from examples.driver_simulator.plants import Context, Intent, SimulatedResponse


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
class ShakyCamera:
    """The camera reads less exactly where a column is high: fine noise, and no movement of the car.

    Parameters
    ----------
    column : str
    size : float
        Standard deviation of the error at the 95 % quantile less that at the 5 % quantile; none at the smallest. [m]
    correlation_time : float
        Of the error. [s]
    """

    column: str
    size: float = 0.04
    correlation_time: float = 0.3
    kind: str = "scale"

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Blur the measurement."""
        strength = SimulatedResponse().scaled(context[self.column])
        keep = np.exp(-STEP / self.correlation_time)
        error = first_order(rng.normal(size=len(strength)), keep, gain=np.sqrt(1.0 - keep**2))
        intent.camera += self.size * (strength - strength.min()) * error
