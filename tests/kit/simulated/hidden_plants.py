"""Planted effects on the driver that no column explains; and a column that explains nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from examples.driver_simulator.motorway import STEP, first_order
from examples.driver_simulator.plants import Context, Intent


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
class DriftingTarget:
    """What the driver holds for the middle drifts slowly.

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
        walk = first_order(rng.normal(size=n), keep)
        intent.target += self.size * (walk - walk.mean()) / walk.std()


@dataclass(frozen=True)
class CyclicTarget:
    """The target goes from side to side with a period.

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
        """Add a sine to the target."""
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
        own = first_order(rng.normal(size=len(source)), np.exp(-STEP / self.time_constant))
        unit = (source - source.mean()) / source.std()
        own = (own - own.mean()) / own.std()
        context[self.name] = self.correlation * unit + np.sqrt(1.0 - self.correlation**2) * own
