"""Planted effects of columns on how much a driver moves, and how hard he comes back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from examples.driver_simulator.plants import Context, Intent, SimulatedResponse


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
    response: SimulatedResponse = field(default_factory=lambda: SimulatedResponse(lag=1.0))
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
    response: SimulatedResponse = field(default_factory=SimulatedResponse)
    kind: str = "dynamics"

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Strengthen or weaken the corrections."""
        intent.gain *= self.factor ** self.response.scaled(context[self.column])
