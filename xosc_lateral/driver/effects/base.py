"""What an effect is: a dependence of the offset on context, time or hidden state that a profile can hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class EffectTerms:
    """What effects do to the base movement, sample by sample. A term that is None changes nothing.

    The offset of a profile with effects is, with m the base model's mean and kappa, phi its coarse and fine part [m]::

        offset = location + m + spread * (kappa(tau) - m) + fine * phi,    d tau / dt = rate

    Parameters
    ----------
    location : array, shape (n,), optional
        Added to the offset. [m]
    spread : array, shape (n,), optional
        Factor on the coarse movement about its mean, > 0. [-]
    rate : array, shape (n,), optional
        Pace of the coarse movement, > 0: 2 means that it restores twice as fast. [-]
    fine : array, shape (n,), optional
        Factor on the fine movement, > 0. [-]
    """

    location: FloatArray | None = None
    spread: FloatArray | None = None
    rate: FloatArray | None = None
    fine: FloatArray | None = None


class Effect(Protocol):
    """One effect. Frozen, small, one file each; parameters and their uncertainty are its fields."""

    kind: ClassVar[str]
    """Name in the profile file, and key in the tuple of known effects."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Context columns that it reads; empty for a hidden effect."""
        ...

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """Evaluate on a uniform time grid. `rng` is for hidden effects only; a column effect leaves it untouched."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; `from_dict` of the class reads them back."""
        ...
